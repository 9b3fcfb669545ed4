"""/v1/volumes: upload, list, show, analyse, render and delete volumes."""

from __future__ import annotations

import hashlib
from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Query, Request, Response, status

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.ranges import Range
from bentray_kernels.requests.rendering_limits import MAX_SMOOTHING
from bentray_workers.files.quantities import QUANTITIES, QuantityName
from bentray_workers.files.volume_formats import RAW_TYPES
from bentray_workers.rendering.coefficients import check_nodes
from bentray_workers.rendering.histogram import BINS, DEFAULT_BINS
from bentray_workers.rendering.refraction_view import RefractionView

from .. import __version__
from ..compute import check_renderable
from ..files.deletion import StoredItem
from ..view_parameters import ViewParameters
from ..web.errors import problems
from ..wiring import Access, Background, CallerTenant, FindVolume, Stores, access_of, caller_of
from . import slices, volume_data, volume_summaries
from .bodies import Limit, accept_upload
from .downloads import headers_of, unchanged
from .models.job_records import HistogramRecord, VolumeList, VolumeRecord
from .pictures import PICTURE, check_render_rate, picture, while_connected
from .record_conversion import volume_record
from .uploads.one_shot_uploads import body_of, receive_upload
from .uploads.upload_metadata import SHAPE, SPACING, volume_metadata

MEDIA_TYPES = ("application/octet-stream", "application/x-npy", "application/x-hdf5")

router = APIRouter(prefix="/v1/volumes", tags=["volumes"])
router.include_router(slices.router)
router.include_router(volume_data.router)
router.include_router(volume_summaries.router)

NPY = "application/x-npy"
SMOOTHING = Range(0.0, MAX_SMOOTHING)


@router.post(
    "",
    status_code=status.HTTP_201_CREATED,
    dependencies=[Depends(accept_upload(*MEDIA_TYPES))],
    openapi_extra=body_of("volume", MEDIA_TYPES),
    responses=problems(413, 415, 422, 503, 507),
)
async def upload_volume(
    request: Request,
    response: Response,
    stores: Stores,
    background: Background,
    access: Access,
    tenant: CallerTenant,
    title: Annotated[str, Query(max_length=200, description="Title; default: that in the file.")] = "",
    spacing_m: Annotated[
        str | None,
        Query(
            max_length=100,
            description="One or three distances, m; NumPy and raw files only, default 0.001.",
            json_schema_extra={"pattern": SPACING},
        ),
    ] = None,
    shape: Annotated[
        str | None,
        Query(
            max_length=100,
            description="nx,ny,nz of a raw file, x fastest.",
            json_schema_extra={"pattern": SHAPE},
        ),
    ] = None,
    dtype: Annotated[
        str | None,
        Query(
            max_length=20,
            description="Data type of a raw file: uint8, int16, float32, ...; big-endian as uint16-be.",
            json_schema_extra={"pattern": "^(" + "|".join(RAW_TYPES) + ")$"},
        ),
    ] = None,
) -> VolumeRecord:
    """Upload a volume. The format is detected from the content; a separate process validates it."""
    given = volume_metadata(title, spacing_m, shape, dtype)
    row = await receive_upload(request, stores, background, access, tenant, stores.volumes.uploaded, given)
    record = volume_record(row)
    response.headers["Location"] = record.links["self"]
    return record


@router.get("", responses=problems(422))
def list_volumes(
    stores: Stores,
    tenant: CallerTenant,
    limit: Limit = 100,
) -> VolumeList:
    """List volumes, reconstructed and uploaded, newest first."""
    return VolumeList(volumes=[volume_record(row) for row in stores.volumes.newest(tenant, limit)])


@router.get("/{volume_id}", responses=problems(404))
def show_volume(volume_id: str, stores: Stores, tenant: CallerTenant) -> VolumeRecord:
    """Show one volume: shape, axes, spacing, origin and range."""
    return volume_record(stores.volumes.get(tenant, volume_id))


@router.delete("/{volume_id}", status_code=status.HTTP_204_NO_CONTENT, responses=problems(404, 409, 503))
def delete_volume(volume_id: str, stores: Stores, tenant: CallerTenant) -> None:
    """Delete a volume with its job and turntables; rejected while an unfinished job needs it."""
    stores.deletion.delete(StoredItem(tenant, "volume", volume_id))


@router.get(
    "/{volume_id}/histogram",
    responses=problems(404, 422, 429, 503),
    dependencies=[Depends(check_render_rate)],
)
async def show_histogram(
    find: FindVolume,
    request: Request,
    background: Background,
    quantity: Annotated[
        Literal[QuantityName, "value"] | None,
        Query(
            description="Reconstructions: speed (default), coverage, attenuation if the scan has amplitudes, "
            "recovery if resolution_check was set, uncertainty (m/s) and reflection (dB) if requested. "
            "Uploads: value."
        ),
    ] = None,
    bins: Annotated[
        int,
        Query(
            ge=BINS.least, le=BINS.most, description="Bins of equal width between least and greatest value."
        ),
    ] = DEFAULT_BINS,
) -> HistogramRecord:
    """Count the nodes of a volume by value, on a worker; and the surface that a picture shows by default."""
    volume = await find()
    uploaded = volume.job_id is None
    chosen = quantity or ("value" if uploaded else "speed")
    if (chosen == "value") != uploaded:
        accepted = "value: this is an uploaded volume" if uploaded else "one of " + ", ".join(QUANTITIES)
        raise InvalidInput("quantity", repr(quantity), accepted)
    work = background.pictures.histogram(volume, chosen, bins)
    return HistogramRecord.model_validate(await while_connected(request, work))


@router.get(
    "/{volume_id}/coefficients",
    response_class=Response,
    responses={
        200: {
            "content": {NPY: {"schema": {"type": "string", "format": "binary"}}},
            "description": "float32 (x, y, z) with the border of the filter, for B-splines of degree 3 and "
            "Catmull-Rom one node before the first one and two after the last one.",
        },
        304: {"description": "Not modified."},
        **problems(404, 422, 429, 503),
    },
)
async def show_coefficients(
    find: FindVolume,
    request: Request,
    background: Background,
    filter: Annotated[  # noqa: A002 - the name of the query parameter
        Literal["bspline3", "catmull-rom"], Query(description="As of refraction.png.")
    ] = "bspline3",
    smoothing: Annotated[
        float | None,
        Query(ge=SMOOTHING.least, le=SMOOTHING.most, description="As of refraction.png."),
    ] = None,
) -> Response:
    """Filter a volume on a worker, and return its coefficients as a NumPy file."""
    volume = await find()
    check_renderable(volume)
    check_nodes(tuple(volume.shape))
    view = RefractionView(filter=filter, smoothing=smoothing)
    seed = repr((__version__, volume.id, volume.created, filter, smoothing))
    tag = f'"{hashlib.sha256(seed.encode()).hexdigest()[:32]}"'
    if (response := unchanged(request, tag)) is not None:
        return response
    access_of(request.scope).sign_in.check_render(caller_of(request))
    work = background.pictures.coefficients(volume, view)
    return Response(await while_connected(request, work), media_type=NPY, headers=headers_of(tag))


@router.head("/{volume_id}/refraction.png", include_in_schema=False)
@router.get("/{volume_id}/refraction.png", response_class=Response, responses=PICTURE)
async def refraction_png(
    find: FindVolume,
    request: Request,
    background: Background,
    view: ViewParameters,
) -> Response:
    """Render a volume as refracting glass before a backdrop, or its surface, on a worker.

    Requires a 3-D volume with uniform spacing. HEAD returns the ETag without rendering, so Content-Length is
    absent.
    """
    volume = await find()
    check_renderable(volume)
    view = view.within(*volume.value_range)
    return await picture(
        request, volume, view.plain(), lambda: background.pictures.refraction_png(volume, view)
    )

"""/v1/volumes: results and uploads as metadata, pictures and files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, Query, Request, Response, status
from fastapi.responses import FileResponse

from bentray_kernels.errors import InvalidInput

from ..errors import described
from ..storage.deletion import Stored
from ..storage.exports import values_as_nifti, values_as_npy
from ..storage.ids import new_id
from ..wiring import CallerTenant, Service
from .bodies import only
from .pictures import PICTURE, picture
from .records import VolumeList, VolumeRecord, volume_record
from .upload_metadata import volume_given
from .uploads import body_of, take_in

MEDIA_TYPES = ("application/octet-stream", "application/x-npy", "application/x-hdf5")

# What makes a file of each format that is not the volume's own, and its extension.
EXPORTS = {"npy": (values_as_npy, "npy"), "nifti": (values_as_nifti, "nii")}

router = APIRouter(prefix="/v1/volumes", tags=["volumes"])


@router.post(
    "",
    status_code=status.HTTP_201_CREATED,
    dependencies=[Depends(only(*MEDIA_TYPES))],
    openapi_extra=body_of("volume", MEDIA_TYPES),
    responses=described(413, 415, 422, 507),
)
async def upload_volume(
    request: Request,
    response: Response,
    service: Service,
    tenant: CallerTenant,
    title: Annotated[str, Query(max_length=200, description="In place of the file's own.")] = "",
    spacing_m: Annotated[
        str | None,
        Query(max_length=100, description="One distance or three, m; NumPy and raw only, 0.001 without it."),
    ] = None,
    shape: Annotated[
        str | None, Query(max_length=100, description="nx,ny,nz of raw bytes, in which x runs fastest.")
    ] = None,
    dtype: Annotated[
        str | None,
        Query(
            max_length=20, description="Of raw bytes: uint8, int16, float32, ...; big-endian as uint16-be."
        ),
    ] = None,
) -> VolumeRecord:
    """Upload a volume. Its content tells the format; a process of its own reads it, or says why not."""
    given = volume_given(title, spacing_m, shape, dtype)
    volume_id = new_id("volume")

    def store(size: int, sha256: str, summary: dict[str, Any]) -> dict[str, Any]:
        return service.volumes.add(tenant, volume_id, size=size, sha256=sha256, summary=summary)

    record = volume_record(await take_in(request, service, tenant, "volume", volume_id, store, given))
    response.headers["Location"] = record.links["self"]
    return record


@router.get("")
def list_volumes(
    service: Service, tenant: CallerTenant, limit: Annotated[int, Query(ge=1, le=1000)] = 100
) -> VolumeList:
    """Volumes, reconstructed and uploaded, newest first."""
    return VolumeList(volumes=[volume_record(row) for row in service.volumes.newest(tenant, limit)])


@router.get("/{volume_id}", responses=described(404))
def show_volume(volume_id: str, service: Service, tenant: CallerTenant) -> VolumeRecord:
    """Shape, axes, spacing, origin and range of one volume."""
    return volume_record(service.volumes.get(tenant, volume_id))


@router.delete("/{volume_id}", status_code=status.HTTP_204_NO_CONTENT, responses=described(404, 409))
def delete_volume(volume_id: str, service: Service, tenant: CallerTenant) -> None:
    """Delete a volume, the job that made it and its turntables; not while a job needs it."""
    service.deletion.delete(Stored(tenant, "volume", volume_id))


@router.head("/{volume_id}/slice.png", include_in_schema=False)
@router.get("/{volume_id}/slice.png", response_class=Response, responses=PICTURE)
def slice_png(
    volume_id: str,
    request: Request,
    service: Service,
    tenant: CallerTenant,
    index: Annotated[int | None, Query(ge=0, description="Axial index; the middle slice without it.")] = None,
    quantity: Annotated[
        Literal["speed", "coverage", "attenuation", "recovery", "value"] | None,
        Query(
            description="What to show. Of a reconstruction: speed, which it is without this, coverage, "
            "attenuation where the scan had amplitudes, recovery where resolution_check was set. Of an "
            "upload: value."
        ),
    ] = None,
    low: Annotated[float | None, Query(description="Value of the darkest colour; m/s for speed.")] = None,
    high: Annotated[float | None, Query(description="Value of the brightest colour.")] = None,
    colormap: Annotated[
        str, Query(max_length=40, description="Name of a Matplotlib colour map.")
    ] = "viridis",
) -> Response:
    """One axial slice as a PNG, drawn by a worker.

    HEAD gives the tag at once, without drawing, so Content-Length is absent.
    """
    volume = service.volumes.get(tenant, volume_id)
    slices = volume["shape"][2] if len(volume["shape"]) == 3 else 1
    if index is not None and index >= slices:
        raise InvalidInput("index", index, f"0 to {slices - 1}")
    for name, value in (("low", low), ("high", high)):
        if value is not None and not math.isfinite(value):
            raise InvalidInput(name, value, "a finite number")
    how: dict[str, Any] = {"index": index, "low": low, "high": high, "colormap": colormap}
    path = service.files.of(tenant).volume(volume["id"])
    if "job_id" in volume:
        if quantity == "value":
            raise InvalidInput("quantity", "'value'", "speed, coverage, attenuation or recovery")
        how["quantity"] = quantity or "speed"
        return picture(request, volume, how, lambda: service.compute.slice_png(path, **how))
    if quantity not in (None, "value"):
        raise InvalidInput("quantity", repr(quantity), "value: this volume was uploaded")
    return picture(request, volume, how, lambda: service.compute.volume_slice_png(path, **how))


@router.get(
    "/{volume_id}/data",
    response_class=FileResponse,
    responses={
        200: {
            "content": {"application/x-hdf5": {}, "application/octet-stream": {}},
            "description": "The file.",
        },
        **described(404, 422),
    },
)
def download(
    volume_id: str,
    service: Service,
    tenant: CallerTenant,
    format: Annotated[  # noqa: A002 - the name of the query parameter
        Literal["hdf5", "nifti", "npy"],
        Query(
            description="hdf5: everything; npy: the values alone, speed in m/s; nifti: these with spacing "
            "and origin in mm, for even spacing."
        ),
    ] = "hdf5",
) -> FileResponse:
    """The volume as a file."""
    volume = service.volumes.get(tenant, volume_id)
    source: Path = service.files.of(tenant).volume(volume["id"])
    if format == "hdf5":
        return FileResponse(source, media_type="application/x-hdf5", filename=f"{volume['id']}.h5")
    export, extension = EXPORTS[format]
    uploaded = "job_id" not in volume
    exported = export(source, service.files.of(tenant).export(volume["id"], extension), uploaded=uploaded)
    name = f"{volume['id']}-{'values' if uploaded else 'speed'}.{extension}"
    return FileResponse(exported, media_type="application/octet-stream", filename=name)

"""/v1/volumes: upload, list, show, analyse, summarise, download, render and delete volumes."""

from dataclasses import asdict
from functools import partial
from typing import Annotated, Any, Literal, cast

from fastapi import APIRouter, Depends, Query, Response, status
from starlette.concurrency import run_in_threadpool

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.limits import FREQUENCY_HZ
from bentray_kernels.requests.ranges import Range
from bentray_kernels.requests.rendering_limits import MAX_SMOOTHING
from bentray_workers.files.export.registry import FORMATS, SINGLE, FormatName
from bentray_workers.files.quantities import QUANTITIES, QuantityName
from bentray_workers.files.reconstruction import shape_of_quantity
from bentray_workers.files.volume_export import REVISION, Selection, largest_bytes
from bentray_workers.files.volume_formats import RAW_TYPES
from bentray_workers.images.plane import check_plane
from bentray_workers.images.slice_style import (
    COLORMAPS,
    COLOUR_VALUE,
    MAX_SIZE,
    MIN_FRAMED_SIZE,
    MIN_SIZE,
    SliceStyle,
)
from bentray_workers.rendering.coefficients import check_nodes
from bentray_workers.rendering.histogram import BINS, DEFAULT_BINS
from bentray_workers.rendering.refraction_view import RefractionView

from .. import __version__
from ..compute import check_renderable
from ..errors import UnknownId
from ..routes.pictures import ViewParameters
from ..rows.tables import DatasetRow, VolumeRow
from ..web.errors import problems
from ..wiring import Context, StoreParts
from .bodies import Limit, accept_upload
from .downloads import download, download_of, file_status, headers_of, tag_of, unchanged, without_length
from .models.job_records import HistogramRecord, VolumeList, VolumeRecord
from .models.summary_records import SummaryRecord
from .pictures import PICTURE, check_render_rate, picture, while_connected
from .record_conversion import volume_record
from .uploads.one_shot_uploads import body_of, receive_upload
from .uploads.upload_metadata import SHAPE, SPACING, volume_metadata

MEDIA_TYPES = ("application/octet-stream", "application/x-npy", "application/x-hdf5")
NPY = "application/x-npy"
SMOOTHING = Range(0.0, MAX_SMOOTHING)
COLOUR_SCHEMA = cast("dict[str, Any]", COLOUR_VALUE.schema)
HDF5 = FORMATS["hdf5"].media_type
EVEN = ", ".join(name for name, form in FORMATS.items() if form.uneven)
ABOUT = "; ".join(f"{name}: {form.content}" for name, form in FORMATS.items())

router = APIRouter(prefix="/v1/volumes", tags=["volumes"])


async def read_style(
    colormap: Annotated[
        str,
        Query(
            description="One of " + ", ".join(COLORMAPS) + ".", json_schema_extra={"enum": list(COLORMAPS)}
        ),
    ] = "viridis",
    size: Annotated[
        int | None,
        Query(
            description=f"Longest side in pixels, {MIN_FRAMED_SIZE} to {MAX_SIZE}, without a frame from "
            f"{MIN_SIZE}. Default: standard text size, and one pixel per node without a frame.",
            json_schema_extra={"minimum": MIN_SIZE, "maximum": MAX_SIZE},
        ),
    ] = None,
    interpolation: Annotated[
        Literal["nearest", "linear", "cubic"], Query(description="Interpolation between nodes.")
    ] = "nearest",
    scale_bar: Annotated[bool, Query(description="Draw a scale bar.")] = False,
    colour_bar: Annotated[
        bool, Query(description="Draw a colour bar with values and unit; framed only.")
    ] = True,
    frame: Annotated[
        bool, Query(description="Draw title, axes in mm and notes; false: the image alone.")
    ] = True,
) -> SliceStyle:
    """The appearance of a slice image."""
    return SliceStyle(colormap, size, interpolation, scale_bar, colour_bar, frame)


@router.head("/{volume_id}/slice.png", include_in_schema=False)
@router.get("/{volume_id}/slice.png", response_class=Response, responses=PICTURE)
async def slice_png(
    volume_id: str,
    context: Context,
    style: Annotated[SliceStyle, Depends(read_style)],
    axis: Annotated[Literal["x", "y", "z"], Query(description="Axis perpendicular to the slice.")] = "z",
    index: Annotated[
        int | None, Query(ge=0, description="Index along this axis; default: the middle.")
    ] = None,
    quantity: Annotated[
        Literal[QuantityName, "value"] | None,
        Query(
            description="Quantity to show. Reconstructions: speed (default), coverage, "
            "attenuation if the scan has amplitudes, recovery if resolution_check was set, "
            "uncertainty (m/s) and reflection (dB) if requested. upload: value."
        ),
    ] = None,
    low: Annotated[
        float | None,
        Query(description="Value of the darkest colour; m/s for speed.", json_schema_extra=COLOUR_SCHEMA),
    ] = None,
    high: Annotated[
        float | None, Query(description="Value of the brightest colour.", json_schema_extra=COLOUR_SCHEMA)
    ] = None,
) -> Response:
    """Render one slice as PNG on a worker.

    HEAD returns the ETag without rendering, so Content-Length is absent.
    """
    volume = await context.volume(volume_id)
    check_plane(volume.shape, volume.spacing_m, axis, index)
    for name, value in (("low", low), ("high", high)):
        if value is not None:
            COLOUR_VALUE.check(name, value)
    uploaded = _check_quantity(volume, quantity)
    how: dict[str, Any] = {"axis": axis, "index": index, "low": low, "high": high, **asdict(style)}
    if not uploaded:
        how["quantity"] = quantity or "speed"
    return await picture(context, volume, how, partial(context.background.pictures.slice_png, volume, how))


def _check_quantity(volume: VolumeRow, quantity: str | None) -> bool:
    """Reject a quantity that a volume cannot have; returns whether it is an upload, which has values only."""
    uploaded = volume.job_id is None
    if quantity is not None and (quantity == "value") != uploaded:
        accepted = "value: this is an uploaded volume" if uploaded else "one of " + ", ".join(QUANTITIES)
        raise InvalidInput("quantity", repr(quantity), accepted)
    return uploaded


@router.head("/{volume_id}/data", include_in_schema=False)
@router.get(
    "/{volume_id}/data",
    response_class=Response,
    responses={
        **download_of(*dict.fromkeys(form.media_type for form in FORMATS.values())),
        **problems(404, 422, 429, 503, 507),
    },
)
async def volume_data(
    volume_id: str,
    context: Context,
    format: Annotated[  # noqa: A002 - the name of the query parameter
        Literal[FormatName, "h5"],
        Query(description=f"{ABOUT}; h5: hdf5. Uneven heights: {EVEN} only."),
    ] = "hdf5",
    quantity: Annotated[
        Literal[QuantityName, "truth"],
        Query(
            description=f"Quantity of {', '.join(SINGLE)} of a reconstruction; truth: the true "
            "speed at its nodes, NaN outside, of a scan that has it. uncertainty: standard deviation of the "
            "speed, m/s. reflection, in dB, has a grid of its own: the other formats then hold this image "
            "alone, otherwise all others."
        ),
    ] = "speed",
    attenuation: Annotated[
        Literal["Np/m", "dB/cm/MHz"],
        Query(description="Unit of the attenuation. dB/cm/MHz refers to the frequency of the scan."),
    ] = "Np/m",
    frequency_hz: Annotated[
        float | None,
        Query(
            ge=FREQUENCY_HZ.least,
            le=FREQUENCY_HZ.most,
            description="Frequency for dB/cm/MHz, Hz; default: that of the scan.",
        ),
    ] = None,
) -> Response:
    """Download a volume.

    Interrupted downloads can be resumed with Range and If-Range. Formats other than hdf5 are exported by a
    worker on the first request; before, HEAD returns no Content-Length.
    """
    kind: FormatName = "hdf5" if format == "h5" else format
    request, stores, tenant = context.request, context.stores, context.tenant
    volume = await context.volume(volume_id)
    files = stores.files.of(tenant)
    # Exports are deleted together with the volume.
    path = await run_in_threadpool(stores.files.store.fetch, files.volume(volume.id))
    seed = repr((volume.id, volume.created, kind))
    of_truth = quantity == "truth"
    selection = Selection(
        "speed" if of_truth else quantity, attenuation, None if attenuation == "Np/m" else frequency_hz
    )
    if of_truth and volume.job_id is None:
        raise InvalidInput("quantity", "truth of an uploaded volume", "none: it has values only")
    if kind == "hdf5":
        if selection != Selection() or of_truth:
            field = "quantity" if quantity != "speed" else "attenuation"
            accepted = "speed and Np/m for hdf5, which holds all quantities in SI units"
            raise InvalidInput(field, f"{quantity}, {attenuation}", accepted)
        return download(request, path, seed, HDF5)
    chosen = FORMATS[kind]
    # Exports are deterministic, so the ETag is computed from the volume.
    which = (
        ""
        if selection == Selection() and not of_truth
        else f"{quantity}-{attenuation.partition('/')[0]}-{selection.frequency_hz}."
    )
    seed = repr((seed, which)) if which else seed
    tag = tag_of(path, repr((__version__, REVISION, seed)))
    if (response := unchanged(request, tag)) is not None:
        return response
    name = f"{volume.id}-{'values' if volume.job_id is None else quantity}.{chosen.download_extension}"
    made = files.export(volume.id, f"{which}{REVISION}.{chosen.download_extension}")
    if not made.exists():
        if request.method == "HEAD":
            headers = {"Accept-Ranges": "bytes", "Content-Disposition": f'attachment; filename="{name}"'}
            return without_length(chosen.media_type, headers_of(tag) | headers)
        context.check_render()
        uploaded, held = volume.job_id is None, "speed" if of_truth else quantity
        shape = await run_in_threadpool(shape_of_quantity, path, held, tuple(volume.shape))
        most = largest_bytes(shape, uploaded=uploaded)
        async with stores.quota.reserved(tenant, made.name, most):
            try:
                if of_truth:
                    scan = await run_in_threadpool(scan_of, stores, volume)
                    work = context.background.pictures.export_truth(volume, scan, made, kind)
                else:
                    work = context.background.pictures.export(volume, made, kind, selection)
                await while_connected(request, work)
            except InvalidInput:
                # Report a volume that was deleted in the meantime as unknown.
                await context.volume(volume.id)
                raise
            await run_in_threadpool(stores.quota.stored, tenant, made.name, file_status(made).st_size)
    response = download(request, made, seed, chosen.media_type, name, tag)
    try:
        await context.volume(volume.id)
    except UnknownId:
        # The export was written after the files of the volume had been deleted.
        made.unlink(missing_ok=True)
        await run_in_threadpool(stores.quota.gone, tenant, made.name)
        raise
    return response


def scan_of(stores: StoreParts, volume: VolumeRow) -> DatasetRow:
    """The scan of a reconstruction.

    Raises:
        InvalidInput: naming ``volume``, for an uploaded one.
    """
    if volume.job_id is None:
        raise InvalidInput("volume", f"{volume.id}, an upload", "the result of a reconstruction")
    return stores.datasets.get(volume.tenant, volume.dataset_id)


@router.get(
    "/{volume_id}/summary",
    responses=problems(404, 422, 429, 503),
    dependencies=[Depends(check_render_rate)],
)
async def show_summary(volume_id: str, context: Context) -> SummaryRecord:
    """Summarise a reconstruction on a worker: quantities, what auto compared, errors against the truth."""
    volume = await context.volume(volume_id)
    scan = await run_in_threadpool(scan_of, context.stores, volume)
    work = context.background.pictures.summary(volume, scan)
    return SummaryRecord.model_validate(await while_connected(context.request, work))


@router.post(
    "",
    status_code=status.HTTP_201_CREATED,
    dependencies=[Depends(accept_upload(*MEDIA_TYPES))],
    openapi_extra=body_of("volume", MEDIA_TYPES),
    responses=problems(413, 415, 422, 503, 507),
)
async def upload_volume(
    response: Response,
    context: Context,
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
    record = volume_record(await receive_upload(context, context.stores.volumes.uploaded, given))
    response.headers["Location"] = record.links["self"]
    return record


@router.get("", responses=problems(422))
def list_volumes(context: Context, limit: Limit = 100) -> VolumeList:
    """List volumes, reconstructed and uploaded, newest first."""
    rows = context.stores.volumes.newest(context.tenant, limit)
    return VolumeList(volumes=[volume_record(row) for row in rows])


@router.get("/{volume_id}", responses=problems(404))
def show_volume(volume_id: str, context: Context) -> VolumeRecord:
    """Show one volume: shape, axes, spacing, origin and range."""
    return volume_record(context.stores.volumes.get(context.tenant, volume_id))


@router.delete("/{volume_id}", status_code=status.HTTP_204_NO_CONTENT, responses=problems(404, 409, 503))
def delete_volume(volume_id: str, context: Context) -> None:
    """Delete a volume with its job and turntables; rejected while an unfinished job needs it."""
    context.delete("volume", volume_id)


@router.get(
    "/{volume_id}/histogram",
    responses=problems(404, 422, 429, 503),
    dependencies=[Depends(check_render_rate)],
)
async def show_histogram(
    volume_id: str,
    context: Context,
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
    volume = await context.volume(volume_id)
    uploaded = _check_quantity(volume, quantity)
    chosen = quantity or ("value" if uploaded else "speed")
    work = context.background.pictures.histogram(volume, chosen, bins)
    return HistogramRecord.model_validate(await while_connected(context.request, work))


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
    volume_id: str,
    context: Context,
    filter: Annotated[  # noqa: A002 - the name of the query parameter
        Literal["bspline3", "catmull-rom"], Query(description="As of refraction.png.")
    ] = "bspline3",
    smoothing: Annotated[
        float | None,
        Query(ge=SMOOTHING.least, le=SMOOTHING.most, description="As of refraction.png."),
    ] = None,
) -> Response:
    """Filter a volume on a worker, and return its coefficients as a NumPy file."""
    volume = await context.volume(volume_id)
    check_renderable(volume)
    check_nodes(tuple(volume.shape))
    view = RefractionView(filter=filter, smoothing=smoothing)
    how = {"filter": filter, "smoothing": smoothing}
    draw = partial(context.background.pictures.coefficients, volume, view)
    return await picture(context, volume, how, draw, NPY)


@router.head("/{volume_id}/refraction.png", include_in_schema=False)
@router.get("/{volume_id}/refraction.png", response_class=Response, responses=PICTURE)
async def refraction_png(volume_id: str, context: Context, view: ViewParameters) -> Response:
    """Render a volume as refracting glass before a backdrop, or its surface, on a worker.

    Requires a 3-D volume with uniform spacing. HEAD returns the ETag without rendering, so Content-Length is
    absent.
    """
    volume = await context.volume(volume_id)
    check_renderable(volume)
    view = view.within(*volume.value_range)
    draw = partial(context.background.pictures.refraction_png, volume, view)
    return await picture(context, volume, view.plain(), draw)

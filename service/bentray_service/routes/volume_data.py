"""/v1/volumes/{id}/data: download of a volume in several formats."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Query, Request, Response
from starlette.concurrency import run_in_threadpool

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.limits import FREQUENCY_HZ
from bentray_workers.files.export.registry import FORMATS, SINGLE, FormatName
from bentray_workers.files.quantities import QuantityName
from bentray_workers.files.reconstruction import shape_of_quantity
from bentray_workers.files.volume_export import REVISION, Selection, largest_bytes

from .. import __version__
from ..errors import UnknownId
from ..web.errors import problems
from ..wiring import Background, CallerTenant, Stores, access_of, caller_of
from .downloads import download, download_of, file_status, headers_of, tag_of, unchanged, without_length
from .pictures import while_connected
from .volume_summaries import scan_of

HDF5 = FORMATS["hdf5"].media_type
EVEN = ", ".join(name for name, form in FORMATS.items() if form.uneven)
ABOUT = "; ".join(f"{name}: {form.content}" for name, form in FORMATS.items())

router = APIRouter()


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
    request: Request,
    stores: Stores,
    background: Background,
    tenant: CallerTenant,
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
    volume = await run_in_threadpool(stores.volumes.get, tenant, volume_id)
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
        access_of(request.scope).sign_in.check_render(caller_of(request))
        uploaded, held = volume.job_id is None, "speed" if of_truth else quantity
        shape = await run_in_threadpool(shape_of_quantity, path, held, tuple(volume.shape))
        most = largest_bytes(shape, uploaded=uploaded)
        async with stores.quota.reserved(tenant, made.name, most):
            try:
                if of_truth:
                    scan = await run_in_threadpool(scan_of, stores, volume)
                    work = background.pictures.export_truth(volume, scan, made, kind)
                else:
                    work = background.pictures.export(volume, made, kind, selection)
                await while_connected(request, work)
            except InvalidInput:
                # Report a volume that was deleted in the meantime as unknown.
                await run_in_threadpool(stores.volumes.get, tenant, volume.id)
                raise
            await run_in_threadpool(stores.quota.stored, tenant, made.name, file_status(made).st_size)
    response = download(request, made, seed, chosen.media_type, name, tag)
    try:
        await run_in_threadpool(stores.volumes.get, tenant, volume.id)
    except UnknownId:
        # The export was written after the files of the volume had been deleted.
        made.unlink(missing_ok=True)
        await run_in_threadpool(stores.quota.gone, tenant, made.name)
        raise
    return response

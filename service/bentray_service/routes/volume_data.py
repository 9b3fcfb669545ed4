"""/v1/volumes/{id}/data: download of a volume in several formats."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Query, Request, Response
from starlette.concurrency import run_in_threadpool

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.volume_export import FORMATS, largest_bytes

from .. import __version__
from ..errors import UnknownId
from ..web.errors import problems
from ..wiring import CallerTenant, Service, caller_of, parts_of
from .downloads import download, download_of, file_status, headers_of, tag_of, unchanged, without_length
from .pictures import while_connected

HDF5 = "application/x-hdf5"

router = APIRouter()


@router.head("/{volume_id}/data", include_in_schema=False)
@router.get(
    "/{volume_id}/data",
    response_class=Response,
    responses={
        **download_of(HDF5, *sorted({one.media_type for one in FORMATS.values()})),
        **problems(404, 422, 429, 503, 507),
    },
)
async def volume_data(
    volume_id: str,
    request: Request,
    service: Service,
    tenant: CallerTenant,
    format: Annotated[  # noqa: A002 - the name of the query parameter
        Literal["hdf5", "h5", "nifti", "metaimage", "mat", "npy"],
        Query(
            description="hdf5 or h5: all data; mat: all images and the grid for MATLAB (version 5); npy: "
            "values only, speed in m/s; nifti and metaimage (.mha): values with spacing and origin in "
            "mm, for uniform spacing."
        ),
    ] = "hdf5",
) -> Response:
    """Download a volume.

    Interrupted downloads can be resumed with Range and If-Range. Formats other than hdf5 are exported by a
    worker on the first request; before, HEAD returns no Content-Length.
    """
    volume = await run_in_threadpool(service.volumes.get, tenant, volume_id)
    files = service.files.of(tenant)
    # Exports are deleted together with the volume.
    path = await run_in_threadpool(service.files.store.fetch, files.volume(volume["id"]))
    seed = repr((volume["id"], volume["created"], "hdf5" if format == "h5" else format))
    if format in ("hdf5", "h5"):
        return download(request, path, seed, HDF5)
    chosen = FORMATS[format]
    # Exports are deterministic, so the ETag is computed from the volume.
    tag = tag_of(path, repr((__version__, seed)))
    if (response := unchanged(request, tag)) is not None:
        return response
    name = f"{volume['id']}-{'speed' if 'job_id' in volume else 'values'}.{chosen.extension}"
    made = files.export(volume["id"], chosen.extension)
    if not made.exists():
        if request.method == "HEAD":
            headers = {"Accept-Ranges": "bytes", "Content-Disposition": f'attachment; filename="{name}"'}
            return without_length(chosen.media_type, headers_of(tag) | headers)
        parts_of(request).sign_in.check_render(caller_of(request))
        most = largest_bytes(volume["shape"], uploaded="job_id" not in volume)
        async with service.quota.reserved(tenant, made.name, most):
            try:
                await while_connected(request, service.pictures.export(tenant, volume, path, made, format))
            except InvalidInput:
                # Report a volume that was deleted in the meantime as unknown.
                await run_in_threadpool(service.volumes.get, tenant, volume["id"])
                raise
            await run_in_threadpool(service.quota.stored, tenant, made.name, file_status(made).st_size)
    response = download(request, made, seed, chosen.media_type, name, tag)
    try:
        await run_in_threadpool(service.volumes.get, tenant, volume["id"])
    except UnknownId:
        # The export was written after the files of the volume had been deleted.
        made.unlink(missing_ok=True)
        await run_in_threadpool(service.quota.gone, tenant, made.name)
        raise
    return response

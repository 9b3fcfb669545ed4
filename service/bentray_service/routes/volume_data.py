"""/v1/volumes/{id}/data: a volume as a file, in any of the formats."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Request, Response

from bentray_kernels.errors import InvalidInput

from ..errors import described
from ..refusals import UnknownId
from ..storage.exports import FORMATS, exported
from ..wiring import CallerTenant, Service
from .downloads import download, download_of

HDF5 = "application/x-hdf5"

router = APIRouter()


@router.head("/{volume_id}/data", include_in_schema=False)
@router.get(
    "/{volume_id}/data",
    response_class=Response,
    responses={
        **download_of(HDF5, *sorted({one.media_type for one in FORMATS.values()})),
        **described(404, 422, 503),
    },
)
def volume_data(
    volume_id: str,
    request: Request,
    service: Service,
    tenant: CallerTenant,
    format: Annotated[  # noqa: A002 - the name of the query parameter
        Literal["hdf5", "h5", "nifti", "metaimage", "mat", "npy"],
        Query(
            description="hdf5 or h5: everything; mat: every image and the grid for MATLAB (version 5); npy: "
            "the values alone, speed in m/s; nifti and metaimage (.mha): these with spacing and origin in "
            "mm, for even spacing."
        ),
    ] = "hdf5",
) -> Response:
    """The volume as a file.

    A download that broke off goes on with Range, and If-Range with the ETag of the first answer.
    """
    volume = service.volumes.get(tenant, volume_id)
    files = service.files.of(tenant)
    # For other formats too: what is made of a volume stays as long as it does.
    path: Path = service.files.store.bring(files.volume(volume["id"]))
    seed = repr((volume["id"], volume["created"], "hdf5" if format == "h5" else format))
    if format in ("hdf5", "h5"):
        return download(request, path, seed, HDF5)
    chosen = FORMATS[format]
    uploaded = "job_id" not in volume
    target = files.export(volume["id"], chosen.extension)
    try:
        made = exported(path, target, chosen, uploaded=uploaded)
    except (InvalidInput, OSError):
        # What is deleted meanwhile is told as that.
        service.files.store.bring(path)
        raise
    name = f"{volume['id']}-{'values' if uploaded else 'speed'}.{chosen.extension}"
    answer = download(request, made, seed, chosen.media_type, name)
    try:
        service.volumes.get(tenant, volume["id"])
    except UnknownId:
        # Made after its files were removed: nobody else would remove it.
        target.unlink(missing_ok=True)
        raise
    return answer

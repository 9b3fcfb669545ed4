"""/v1/volumes: results as metadata, pictures and files."""

from __future__ import annotations

import hashlib
import math
from pathlib import Path
from typing import Annotated, Literal

from fastapi import APIRouter, Header, Query, Response
from fastapi.responses import FileResponse

from bentray_kernels.errors import InvalidInput

from .. import __version__
from ..errors import described
from ..storage.exports import speed_as_npy
from ..wiring import Service
from .records import VolumeRecord, volume_record

router = APIRouter(prefix="/v1/volumes", tags=["volumes"], responses=described(404))


@router.get("/{volume_id}")
def show_volume(volume_id: str, service: Service) -> VolumeRecord:
    """Shape, axes, spacing and origin of one result."""
    return volume_record(service.volumes.get(volume_id))


@router.get(
    "/{volume_id}/slice.png",
    response_class=Response,
    responses={
        200: {"content": {"image/png": {}}, "description": "The picture."},
        304: {"description": "The picture that the client has is still right."},
        **described(503),
    },
)
def slice_png(
    volume_id: str,
    service: Service,
    index: Annotated[int | None, Query(ge=0, description="Axial index; the middle slice without it.")] = None,
    quantity: Annotated[
        Literal["speed", "coverage", "attenuation", "recovery"],
        Query(
            description="What to show; attenuation where the scan had amplitudes, "
            "recovery where resolution_check was set."
        ),
    ] = "speed",
    low: Annotated[float | None, Query(description="Value of the darkest colour; m/s for speed.")] = None,
    high: Annotated[float | None, Query(description="Value of the brightest colour.")] = None,
    colormap: Annotated[
        str, Query(max_length=40, description="Name of a Matplotlib colour map.")
    ] = "viridis",
    if_none_match: Annotated[str | None, Header(include_in_schema=False)] = None,
) -> Response:
    """One axial slice as a PNG, drawn by a worker."""
    volume = service.volumes.get(volume_id)
    slices = volume["shape"][2] if len(volume["shape"]) == 3 else 1
    if index is not None and index >= slices:
        raise InvalidInput("index", index, f"0 to {slices - 1}")
    for name, value in (("low", low), ("high", high)):
        if value is not None and not math.isfinite(value):
            raise InvalidInput(name, value, "a finite number")
    how = {"index": index, "quantity": quantity, "low": low, "high": high, "colormap": colormap}
    seed = repr((__version__, volume["id"], volume["created"], sorted(how.items())))
    tag = f'"{hashlib.sha256(seed.encode()).hexdigest()[:32]}"'
    headers = {"ETag": tag, "Cache-Control": "private, no-cache"}
    if if_none_match is not None and tag in if_none_match:
        return Response(status_code=304, headers=headers)
    png = service.compute.slice_png(service.files.volume(volume["id"]), **how)
    return Response(png, media_type="image/png", headers=headers)


@router.get(
    "/{volume_id}/data",
    response_class=FileResponse,
    responses={
        200: {
            "content": {"application/x-hdf5": {}, "application/octet-stream": {}},
            "description": "The file.",
        }
    },
)
def download(
    volume_id: str,
    service: Service,
    format: Annotated[  # noqa: A002 - the name of the query parameter
        Literal["hdf5", "npy"], Query(description="hdf5: everything; npy: the speed in m/s alone.")
    ] = "hdf5",
) -> FileResponse:
    """The result as a file."""
    volume = service.volumes.get(volume_id)
    source: Path = service.files.volume(volume["id"])
    if format == "hdf5":
        return FileResponse(source, media_type="application/x-hdf5", filename=f"{volume['id']}.h5")
    exported = speed_as_npy(source, service.files.export(volume["id"], "npy"))
    return FileResponse(exported, media_type="application/octet-stream", filename=f"{volume['id']}-speed.npy")

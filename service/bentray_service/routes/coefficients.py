"""/v1/volumes/{id}/coefficients: a filtered volume, for pages and programs that cast rays themselves."""

from __future__ import annotations

import hashlib
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Request, Response

from bentray_kernels.ranges import Range
from bentray_kernels.rendering_limits import MAX_SMOOTHING
from bentray_workers.rendering.coefficients import check_nodes
from bentray_workers.rendering.refraction_view import RefractionView

from .. import __version__
from ..compute import check_renderable
from ..web.errors import problems
from ..wiring import Background, FindVolume, access_of, caller_of
from .downloads import headers_of, unchanged
from .pictures import while_connected

NPY = "application/x-npy"
SMOOTHING = Range(0.0, MAX_SMOOTHING)

router = APIRouter()


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
    check_renderable(volume.row)
    check_nodes(tuple(volume.row.shape))
    view = RefractionView(filter=filter, smoothing=smoothing)
    seed = repr((__version__, volume.row.id, volume.row.created, filter, smoothing))
    tag = f'"{hashlib.sha256(seed.encode()).hexdigest()[:32]}"'
    if (response := unchanged(request, tag)) is not None:
        return response
    access_of(request.scope).sign_in.check_render(caller_of(request))
    work = background.pictures.coefficients(*volume, view)
    return Response(await while_connected(request, work), media_type=NPY, headers=headers_of(tag))

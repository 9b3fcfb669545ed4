"""/v1/volumes/{id}/refraction.png: refractive rendering of a volume."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from ..compute import check_renderable
from ..view_parameters import ViewParameters
from ..wiring import Background, FindVolume
from .pictures import PICTURE, picture

router = APIRouter(prefix="/v1/volumes", tags=["volumes"])


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
    check_renderable(volume.row)
    view = view.within(*volume.row.value_range)
    return await picture(
        request, volume.row, view.plain(), lambda: background.pictures.refraction_png(*volume, view)
    )

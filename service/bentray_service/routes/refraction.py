"""/v1/volumes/{id}/refraction.png: a volume as glass before a backdrop."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Header, Response

from ..asked_view import AskedView
from ..wiring import Service
from .pictures import PICTURE, check_renderable, picture

router = APIRouter(prefix="/v1/volumes", tags=["volumes"])


@router.head("/{volume_id}/refraction.png", include_in_schema=False)
@router.get("/{volume_id}/refraction.png", response_class=Response, responses=PICTURE)
def refraction_png(
    volume_id: str,
    service: Service,
    view: AskedView,
    if_none_match: Annotated[str | None, Header(include_in_schema=False)] = None,
) -> Response:
    """A volume as glass before a backdrop, or its surface, cast by a worker.

    Works for volumes in space with even spacing, reconstructed or uploaded.
    """
    volume = service.volumes.get(volume_id)
    check_renderable(volume)
    view = view.within(*volume["value_range"])
    path = service.files.volume(volume["id"])
    return picture(volume, view.plain(), if_none_match, lambda: service.compute.refraction_png(path, view))

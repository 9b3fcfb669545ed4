"""/v1/volumes/{id}/refraction.png: refractive rendering of a volume."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response
from starlette.concurrency import run_in_threadpool

from ..compute import check_renderable
from ..view_parameters import ViewParameters
from ..wiring import Background, CallerTenant, Stores
from .pictures import PICTURE, picture

router = APIRouter(prefix="/v1/volumes", tags=["volumes"])


@router.head("/{volume_id}/refraction.png", include_in_schema=False)
@router.get("/{volume_id}/refraction.png", response_class=Response, responses=PICTURE)
async def refraction_png(
    volume_id: str,
    request: Request,
    stores: Stores,
    background: Background,
    tenant: CallerTenant,
    view: ViewParameters,
) -> Response:
    """Render a volume as refracting glass before a backdrop, or its surface, on a worker.

    Requires a 3-D volume with uniform spacing. HEAD returns the ETag without rendering, so Content-Length is
    absent.
    """
    volume = await run_in_threadpool(stores.volumes.get, tenant, volume_id)
    check_renderable(volume)
    view = view.within(*volume.value_range)
    path = stores.files.of(tenant).volume(volume.id)
    return await picture(
        request, volume, view.plain(), lambda: background.pictures.refraction_png(tenant, volume, path, view)
    )

"""/v1/geometry-fields: list geometry fields, show their metrics and images."""

from __future__ import annotations

from functools import partial

from fastapi import APIRouter, Request, Response

from ..view_parameters import FieldViewParameters
from ..web.errors import problems
from ..wiring import Background, CallerTenant, FindField, Stores
from .bodies import Limit
from .models.surface_records import FieldList, FieldRecord
from .pictures import PICTURE, picture
from .record_conversion import field_record

router = APIRouter(prefix="/v1/geometry-fields", tags=["geometry-fields"])


@router.get("", responses=problems(422))
def list_fields(
    stores: Stores,
    tenant: CallerTenant,
    limit: Limit = 100,
) -> FieldList:
    """List geometry fields, newest first."""
    rows = stores.geometry_fields.newest(tenant, limit)
    return FieldList(geometry_fields=[field_record(row) for row in rows])


@router.get("/{field_id}", responses=problems(404))
def show_field(field_id: str, stores: Stores, tenant: CallerTenant) -> FieldRecord:
    """Show one geometry field: sizes, errors and computing times."""
    return field_record(stores.geometry_fields.get(tenant, field_id))


@router.head("/{field_id}/image.png", include_in_schema=False)
@router.get("/{field_id}/image.png", response_class=Response, responses=PICTURE)
async def image_png(
    find: FindField, request: Request, background: Background, view: FieldViewParameters
) -> Response:
    """Render a scene with the mesh as mirror, glass or clay, using the geometry field for secondary rays.

    HEAD returns the ETag without rendering, so Content-Length is absent.
    """
    field = await find()
    view.check_samples(field.settings["samples"])
    return await picture(request, field, view.plain(), lambda: background.pictures.field_png(field, view))


@router.head("/{field_id}/geometry-image.png", include_in_schema=False)
@router.get("/{field_id}/geometry-image.png", response_class=Response, responses=PICTURE)
async def geometry_image_png(find: FindField, request: Request, background: Background) -> Response:
    """The geometry image: surface positions as colours over the unit square."""
    return await _map(find, request, background, "positions")


@router.head("/{field_id}/normal-map.png", include_in_schema=False)
@router.get("/{field_id}/normal-map.png", response_class=Response, responses=PICTURE)
async def normal_map_png(find: FindField, request: Request, background: Background) -> Response:
    """The normal map: surface normals as colours over the unit square."""
    return await _map(find, request, background, "normals")


async def _map(find: FindField, request: Request, background: Background, which: str) -> Response:
    field = await find()
    draw = partial(background.pictures.field_map_png, field, which)
    return await picture(request, field, {"map": which}, draw)

"""/v1/geometry-fields: list geometry fields, show their metrics and images."""

from functools import partial

from fastapi import APIRouter, Response

from ..routes.pictures import FieldViewParameters
from ..web.errors import problems
from ..wiring import Context, RequestContext
from .bodies import Limit
from .models.surface_records import FieldList, FieldRecord
from .pictures import PICTURE, picture
from .record_conversion import field_record

router = APIRouter(prefix="/v1/geometry-fields", tags=["geometry-fields"])


@router.get("", responses=problems(422))
def list_fields(context: Context, limit: Limit = 100) -> FieldList:
    """List geometry fields, newest first."""
    rows = context.stores.geometry_fields.newest(context.tenant, limit)
    return FieldList(geometry_fields=[field_record(row) for row in rows])


@router.get("/{field_id}", responses=problems(404))
def show_field(field_id: str, context: Context) -> FieldRecord:
    """Show one geometry field: sizes, errors and computing times."""
    return field_record(context.stores.geometry_fields.get(context.tenant, field_id))


@router.head("/{field_id}/image.png", include_in_schema=False)
@router.get("/{field_id}/image.png", response_class=Response, responses=PICTURE)
async def image_png(field_id: str, context: Context, view: FieldViewParameters) -> Response:
    """Render a scene with the mesh as mirror, glass or clay, using the geometry field for secondary rays.

    HEAD returns the ETag without rendering, so Content-Length is absent.
    """
    field = await context.field(field_id)
    view.check_samples(field.settings["samples"])
    draw = partial(context.background.pictures.mesh_png, field, view)
    return await picture(context, field, view.plain(), draw)


@router.head("/{field_id}/geometry-image.png", include_in_schema=False)
@router.get("/{field_id}/geometry-image.png", response_class=Response, responses=PICTURE)
async def geometry_image_png(field_id: str, context: Context) -> Response:
    """The geometry image: surface positions as colours over the unit square."""
    return await _map(field_id, context, "positions")


@router.head("/{field_id}/normal-map.png", include_in_schema=False)
@router.get("/{field_id}/normal-map.png", response_class=Response, responses=PICTURE)
async def normal_map_png(field_id: str, context: Context) -> Response:
    """The normal map: surface normals as colours over the unit square."""
    return await _map(field_id, context, "normals")


async def _map(field_id: str, context: RequestContext, which: str) -> Response:
    field = await context.field(field_id)
    draw = partial(context.background.pictures.field_map_png, field, which)
    return await picture(context, field, {"map": which}, draw)

"""/v1/meshes: upload, list and delete triangle meshes; iso-surfaces of volumes."""

import math
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Query, Response, status
from starlette.concurrency import run_in_threadpool

from bentray_kernels.errors import InvalidInput
from bentray_workers.rendering.isosurface_mesh import MAX_STEP, check_nodes, largest_bytes

from ..compute import check_renderable
from ..files.disk import digest_of
from ..rows.ids import new_id
from ..rows.tables import MeshRow
from ..web.errors import problems
from ..wiring import Context
from .bodies import Limit, accept_upload
from .models.surface_records import MeshList, MeshRecord
from .pictures import PICTURE, MeshViewParameters, picture, while_connected
from .record_conversion import mesh_record
from .uploads.one_shot_uploads import body_of, receive_upload

MEDIA_TYPES = (
    "application/octet-stream",
    "model/gltf-binary",
    "model/gltf+json",
    "model/obj",
    "model/stl",
)

router = APIRouter(prefix="/v1", tags=["meshes"])


@router.post(
    "/meshes",
    status_code=status.HTTP_201_CREATED,
    dependencies=[Depends(accept_upload(*MEDIA_TYPES))],
    openapi_extra=body_of("mesh", MEDIA_TYPES),
    responses=problems(413, 415, 422, 503, 507),
)
async def upload_mesh(
    response: Response,
    context: Context,
    title: Annotated[str, Query(max_length=200, description="Title.")] = "",
) -> MeshRecord:
    """Upload a mesh. A separate process validates and repairs it."""
    record = mesh_record(await receive_upload(context, context.stores.meshes, {"title": title}))
    response.headers["Location"] = record.links["self"]
    return record


@router.get("/meshes", responses=problems(422))
def list_meshes(context: Context, limit: Limit = 100) -> MeshList:
    """List meshes, newest first."""
    rows = context.stores.meshes.newest(context.tenant, limit)
    return MeshList(meshes=[mesh_record(row) for row in rows])


@router.get("/meshes/{mesh_id}", responses=problems(404))
def show_mesh(mesh_id: str, context: Context) -> MeshRecord:
    """Show one mesh: size, genus, holes and repairs."""
    return mesh_record(context.stores.meshes.get(context.tenant, mesh_id))


@router.head("/meshes/{mesh_id}/image.png", include_in_schema=False)
@router.get("/meshes/{mesh_id}/image.png", response_class=Response, responses=PICTURE)
async def mesh_png(mesh_id: str, context: Context, view: MeshViewParameters) -> Response:
    """Render a scene with the mesh as mirror, glass or clay, by exact intersection, without a field.

    Images of its geometry field are faster and have the colours of the vertices. HEAD returns the ETag
    without rendering, so Content-Length is absent.
    """
    mesh = await context.mesh(mesh_id)
    draw = partial(context.background.pictures.mesh_png, mesh, view)
    return await picture(context, mesh, view.plain(), draw)


@router.delete("/meshes/{mesh_id}", status_code=status.HTTP_204_NO_CONTENT, responses=problems(404, 409, 503))
def delete_mesh(mesh_id: str, context: Context) -> None:
    """Delete a mesh with its geometry fields and their jobs; rejected while an unfinished job needs it."""
    context.delete("mesh", mesh_id)


@router.post(
    "/volumes/{volume_id}/mesh",
    status_code=status.HTTP_201_CREATED,
    responses=problems(404, 422, 429, 503, 507),
)
async def mesh_of_volume(
    volume_id: str,
    response: Response,
    context: Context,
    iso: Annotated[
        float | None, Query(description="Iso-value in the unit of the volume; default: middle of its range.")
    ] = None,
    step: Annotated[int, Query(ge=1, le=MAX_STEP, description="Use every n-th node: fewer faces.")] = 1,
) -> MeshRecord:
    """Extract an iso-surface of a volume as a mesh: the largest component, closed at the boundary."""
    stores, tenant = context.stores, context.tenant
    volume = await context.volume(volume_id)
    check_renderable(volume)
    check_nodes(tuple(volume.shape), step)
    low, high = volume.value_range
    # NaN fails both comparisons.
    if iso is not None and not (math.isfinite(iso) and low <= iso < high):
        raise InvalidInput("iso", iso, f"{low:g} to less than {high:g}, the range of the volume")
    mesh_id, files = new_id("mesh"), stores.files.of(tenant)
    context.check_render()

    def store(made: Path, summary: dict[str, Any]) -> MeshRow:
        stores.quota.resize(tenant, mesh_id, made.stat().st_size)
        size, sha256 = digest_of(files.adopt(mesh_id))
        columns = summary | {"title": volume.title, "volume_id": volume.id}
        return stores.meshes.add(tenant, mesh_id, size=size, sha256=sha256, summary=columns)

    async with stores.quota.reserved(tenant, mesh_id, largest_bytes(volume.shape, step)):
        try:
            made = files.candidate(mesh_id)
            work = context.background.pictures.mesh_volume(volume, iso, step, made)
            row = await run_in_threadpool(store, made, await while_connected(context.request, work))
        finally:
            files.discard_candidate(mesh_id)
    record = mesh_record(row)
    response.headers["Location"] = record.links["self"]
    return record

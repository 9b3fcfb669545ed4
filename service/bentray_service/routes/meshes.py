"""/v1/meshes: upload, list and delete triangle meshes; iso-surfaces of volumes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Query, Request, Response, status
from starlette.concurrency import run_in_threadpool

from bentray_kernels.errors import InvalidInput
from bentray_workers.rendering.isosurface_mesh import MAX_STEP, check_nodes, largest_bytes

from ..compute import check_renderable
from ..files.deletion import StoredItem
from ..files.disk import digest_of
from ..rows.ids import new_id
from ..rows.tables import MeshRow
from ..web.errors import problems
from ..wiring import Access, Background, CallerTenant, CurrentCaller, Stores
from .bodies import Limit, accept_upload
from .models.surface_records import MeshList, MeshRecord
from .pictures import while_connected
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
    request: Request,
    response: Response,
    stores: Stores,
    background: Background,
    access: Access,
    tenant: CallerTenant,
    title: Annotated[str, Query(max_length=200, description="Title.")] = "",
) -> MeshRecord:
    """Upload a mesh. A separate process validates and repairs it."""
    row = await receive_upload(request, stores, background, access, tenant, stores.meshes, {"title": title})
    record = mesh_record(row)
    response.headers["Location"] = record.links["self"]
    return record


@router.get("/meshes", responses=problems(422))
def list_meshes(
    stores: Stores,
    tenant: CallerTenant,
    limit: Limit = 100,
) -> MeshList:
    """List meshes, newest first."""
    return MeshList(meshes=[mesh_record(row) for row in stores.meshes.newest(tenant, limit)])


@router.get("/meshes/{mesh_id}", responses=problems(404))
def show_mesh(mesh_id: str, stores: Stores, tenant: CallerTenant) -> MeshRecord:
    """Show one mesh: size, genus, holes and repairs."""
    return mesh_record(stores.meshes.get(tenant, mesh_id))


@router.delete("/meshes/{mesh_id}", status_code=status.HTTP_204_NO_CONTENT, responses=problems(404, 409, 503))
def delete_mesh(mesh_id: str, stores: Stores, tenant: CallerTenant) -> None:
    """Delete a mesh with its geometry fields and their jobs; rejected while an unfinished job needs it."""
    stores.deletion.delete(StoredItem(tenant, "mesh", mesh_id))


@router.post(
    "/volumes/{volume_id}/mesh",
    status_code=status.HTTP_201_CREATED,
    responses=problems(404, 422, 429, 503, 507),
)
async def mesh_of_volume(
    volume_id: str,
    request: Request,
    response: Response,
    stores: Stores,
    background: Background,
    access: Access,
    tenant: CallerTenant,
    caller: CurrentCaller,
    iso: Annotated[
        float | None, Query(description="Iso-value in the unit of the volume; default: middle of its range.")
    ] = None,
    step: Annotated[int, Query(ge=1, le=MAX_STEP, description="Use every n-th node: fewer faces.")] = 1,
) -> MeshRecord:
    """Extract an iso-surface of a volume as a mesh: the largest component, closed at the boundary."""
    volume = await run_in_threadpool(stores.volumes.get, tenant, volume_id)
    check_renderable(volume)
    check_nodes(tuple(volume.shape), step)
    low, high = volume.value_range
    # NaN fails both comparisons.
    if iso is not None and not (math.isfinite(iso) and low <= iso < high):
        raise InvalidInput("iso", iso, f"{low:g} to less than {high:g}, the range of the volume")
    mesh_id, files = new_id("mesh"), stores.files.of(tenant)
    access.sign_in.check_render(caller)

    def store(made: Path, summary: dict[str, Any]) -> MeshRow:
        stores.quota.resize(tenant, mesh_id, made.stat().st_size)
        size, sha256 = digest_of(files.adopt(mesh_id))
        columns = summary | {"title": volume.title, "volume_id": volume.id}
        return stores.meshes.add(tenant, mesh_id, size=size, sha256=sha256, summary=columns)

    async with stores.quota.reserved(tenant, mesh_id, largest_bytes(volume.shape, step)):
        try:
            made = files.candidate(mesh_id)
            work = background.pictures.mesh_volume(volume, iso, step, made)
            row = await run_in_threadpool(store, made, await while_connected(request, work))
        finally:
            files.discard_candidate(mesh_id)
    record = mesh_record(row)
    response.headers["Location"] = record.links["self"]
    return record

"""/v1/volumes: results and uploads as metadata, pictures and files."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Depends, Query, Request, Response, status

from bentray_workers.files.volume_formats import RAW_TYPES

from ..files.deletion import StoredItem
from ..web.errors import problems
from ..wiring import CallerTenant, Service
from . import slices, volume_data
from .bodies import Limit, accept_media_types
from .models.records import VolumeList, VolumeRecord
from .records import volume_record
from .upload_metadata import SHAPE, SPACING, volume_given
from .uploads import body_of, receive_upload

MEDIA_TYPES = ("application/octet-stream", "application/x-npy", "application/x-hdf5")

router = APIRouter(prefix="/v1/volumes", tags=["volumes"])
router.include_router(slices.router)
router.include_router(volume_data.router)


@router.post(
    "",
    status_code=status.HTTP_201_CREATED,
    dependencies=[Depends(accept_media_types(*MEDIA_TYPES))],
    openapi_extra=body_of("volume", MEDIA_TYPES),
    responses=problems(413, 415, 422, 503, 507),
)
async def upload_volume(
    request: Request,
    response: Response,
    service: Service,
    tenant: CallerTenant,
    title: Annotated[str, Query(max_length=200, description="In place of the file's own.")] = "",
    spacing_m: Annotated[
        str | None,
        Query(
            max_length=100,
            description="One distance or three, m; NumPy and raw only, 0.001 without it.",
            json_schema_extra={"pattern": SPACING},
        ),
    ] = None,
    shape: Annotated[
        str | None,
        Query(
            max_length=100,
            description="nx,ny,nz of raw bytes, in which x runs fastest.",
            json_schema_extra={"pattern": SHAPE},
        ),
    ] = None,
    dtype: Annotated[
        str | None,
        Query(
            max_length=20,
            description="Of raw bytes: uint8, int16, float32, ...; big-endian as uint16-be.",
            json_schema_extra={"pattern": "^(" + "|".join(RAW_TYPES) + ")$"},
        ),
    ] = None,
) -> VolumeRecord:
    """Upload a volume. Its content tells the format; a process of its own reads it, or says why not."""
    given = volume_given(title, spacing_m, shape, dtype)
    row = await receive_upload(request, service, tenant, service.volumes, given)
    record = volume_record(row)
    response.headers["Location"] = record.links["self"]
    return record


@router.get("", responses=problems(422))
def list_volumes(
    service: Service,
    tenant: CallerTenant,
    limit: Limit = 100,
) -> VolumeList:
    """Volumes, reconstructed and uploaded, newest first."""
    return VolumeList(volumes=[volume_record(row) for row in service.volumes.newest(tenant, limit)])


@router.get("/{volume_id}", responses=problems(404))
def show_volume(volume_id: str, service: Service, tenant: CallerTenant) -> VolumeRecord:
    """Shape, axes, spacing, origin and range of one volume."""
    return volume_record(service.volumes.get(tenant, volume_id))


@router.delete("/{volume_id}", status_code=status.HTTP_204_NO_CONTENT, responses=problems(404, 409, 503))
def delete_volume(volume_id: str, service: Service, tenant: CallerTenant) -> None:
    """Delete a volume, the job that made it and its turntables; not while a job needs it."""
    service.deletion.delete(StoredItem(tenant, "volume", volume_id))

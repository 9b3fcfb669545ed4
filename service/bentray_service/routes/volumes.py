"""/v1/volumes: upload, list, show and delete volumes."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Depends, Query, Request, Response, status

from bentray_workers.files.volume_formats import RAW_TYPES

from ..files.deletion import StoredItem
from ..web.errors import problems
from ..wiring import Access, Background, CallerTenant, Stores
from . import coefficients, histograms, slices, volume_data, volume_summaries
from .bodies import Limit, accept_media_types
from .models.job_records import VolumeList, VolumeRecord
from .record_conversion import volume_record
from .uploads.one_shot_uploads import body_of, receive_upload
from .uploads.upload_metadata import SHAPE, SPACING, volume_metadata

MEDIA_TYPES = ("application/octet-stream", "application/x-npy", "application/x-hdf5")

router = APIRouter(prefix="/v1/volumes", tags=["volumes"])
router.include_router(slices.router)
router.include_router(histograms.router)
router.include_router(coefficients.router)
router.include_router(volume_data.router)
router.include_router(volume_summaries.router)


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
    stores: Stores,
    background: Background,
    access: Access,
    tenant: CallerTenant,
    title: Annotated[str, Query(max_length=200, description="Title; default: that in the file.")] = "",
    spacing_m: Annotated[
        str | None,
        Query(
            max_length=100,
            description="One or three distances, m; NumPy and raw files only, default 0.001.",
            json_schema_extra={"pattern": SPACING},
        ),
    ] = None,
    shape: Annotated[
        str | None,
        Query(
            max_length=100,
            description="nx,ny,nz of a raw file, x fastest.",
            json_schema_extra={"pattern": SHAPE},
        ),
    ] = None,
    dtype: Annotated[
        str | None,
        Query(
            max_length=20,
            description="Data type of a raw file: uint8, int16, float32, ...; big-endian as uint16-be.",
            json_schema_extra={"pattern": "^(" + "|".join(RAW_TYPES) + ")$"},
        ),
    ] = None,
) -> VolumeRecord:
    """Upload a volume. The format is detected from the content; a separate process validates it."""
    given = volume_metadata(title, spacing_m, shape, dtype)
    row = await receive_upload(request, stores, background, access, tenant, stores.volumes.uploaded, given)
    record = volume_record(row)
    response.headers["Location"] = record.links["self"]
    return record


@router.get("", responses=problems(422))
def list_volumes(
    stores: Stores,
    tenant: CallerTenant,
    limit: Limit = 100,
) -> VolumeList:
    """List volumes, reconstructed and uploaded, newest first."""
    return VolumeList(volumes=[volume_record(row) for row in stores.volumes.newest(tenant, limit)])


@router.get("/{volume_id}", responses=problems(404))
def show_volume(volume_id: str, stores: Stores, tenant: CallerTenant) -> VolumeRecord:
    """Show one volume: shape, axes, spacing, origin and range."""
    return volume_record(stores.volumes.get(tenant, volume_id))


@router.delete("/{volume_id}", status_code=status.HTTP_204_NO_CONTENT, responses=problems(404, 409, 503))
def delete_volume(volume_id: str, stores: Stores, tenant: CallerTenant) -> None:
    """Delete a volume with its job and turntables; rejected while an unfinished job needs it."""
    stores.deletion.delete(StoredItem(tenant, "volume", volume_id))

"""/v1/direct-uploads: files that clients send straight to the bucket, by presigned addresses."""

from __future__ import annotations

import base64
from typing import Annotated

from fastapi import APIRouter, Body, Depends, Response, status
from fastapi.openapi.models import Example

from bentray_kernels.errors import InvalidInput

from ...errors import NoBucket, TooLarge, WrongOffset
from ...files.direct_uploads import DirectUploads, part_sizes
from ...rows.ids import Tenant
from ...rows.tables import UploadRow
from ...web.errors import problems
from ...wiring import Access, Background, CallerTenant, Stores
from ..bodies import SmallBody, accept_media_types
from ..models.upload_records import (
    DirectUploadRecord,
    DirectUploadRequest,
    PartAddresses,
    PartRecord,
    PartsRequest,
)
from ..record_conversion import upload_record
from .upload_metadata import read_metadata

FILES: dict[str, Example] = {
    "scan": {"summary": "A scan of 3 GB", "value": {"kind": "dataset", "length": 3000000000}},
    "volume": {
        "summary": "A volume",
        "value": {"kind": "volume", "length": 64000128, "metadata": {"spacing_m": "0.001"}},
    },
}
NUMBERS: dict[str, Example] = {"parts": {"summary": "The first two", "value": {"numbers": [1, 2]}}}
JSON = [Depends(accept_media_types("application/json"))]

router = APIRouter(prefix="/v1/direct-uploads", tags=["uploads"], route_class=SmallBody)


@router.post(
    "",
    status_code=status.HTTP_201_CREATED,
    dependencies=JSON,
    responses=problems(400, 409, 413, 415, 422, 503, 507),
)
def create_direct_upload(
    upload: Annotated[DirectUploadRequest, Body(openapi_examples=FILES)],
    response: Response,
    stores: Stores,
    background: Background,
    access: Access,
    tenant: CallerTenant,
) -> DirectUploadRecord:
    """Create an upload; send its parts to the addresses of `parts`, then `complete` it."""
    _direct(stores)
    said = {**upload.metadata, "kind": upload.kind}
    header = ",".join(f"{name} {base64.b64encode(text.encode()).decode()}" for name, text in said.items())
    what, given = read_metadata(header)
    most = access.settings.max_upload_bytes
    if upload.length > most:
        accepted = f"at most {most} bytes (BENTRAY_MAX_UPLOAD_BYTES)"
        raise TooLarge("length", f"{upload.length} bytes", accepted)
    background.ingest.upload_limits.check_begin(tenant)
    keep_s, most_bytes = access.settings.upload_keep_s, stores.quota.most_bytes
    row = background.ingest.uploads.add(tenant, what, upload.length, given, header, keep_s, most_bytes)
    row = background.ingest.uploads.set_direct(row)
    record = _record(row)
    response.headers["Location"] = record.links["self"]
    return record


@router.post("/{upload_id}/parts", dependencies=JSON, responses=problems(400, 404, 409, 413, 415, 422, 503))
def show_parts(
    upload_id: str,
    parts: Annotated[PartsRequest, Body(openapi_examples=NUMBERS)],
    stores: Stores,
    background: Background,
    access: Access,
    tenant: CallerTenant,
) -> PartAddresses:
    """Show addresses for parts, valid for an hour: PUT each, with exactly `bytes` and without a key.

    A part may be sent again. Those with the size in `received` are in the bucket.
    """
    row, direct = _receiving(stores, background, tenant, upload_id)
    sizes = part_sizes(row.length)
    for number in parts.numbers:
        if number > len(sizes):
            raise InvalidInput("numbers", number, f"1 to {len(sizes)}")
    received = direct.received(row)
    background.ingest.uploads.keep(row.id, access.settings.upload_keep_s)
    return PartAddresses(
        parts=[
            PartRecord(number=one, bytes=sizes[one - 1], url=direct.part_url(row, one))
            for one in parts.numbers
        ],
        received=[
            number for number, size in received.items() if number <= len(sizes) and size == sizes[number - 1]
        ],
    )


@router.post(
    "/{upload_id}/complete", status_code=status.HTTP_202_ACCEPTED, responses=problems(404, 409, 423, 503)
)
def complete_direct_upload(
    upload_id: str, stores: Stores, background: Background, tenant: CallerTenant
) -> DirectUploadRecord:
    """Complete an upload. It is ingested in the background; poll it with `GET /v1/uploads/{id}`."""
    background.ingest.uploads.get(tenant, upload_id)
    with background.ingest.locks(upload_id):
        row = background.ingest.uploads.get(tenant, upload_id)
        if row.multipart_id is None or row.state == "receiving":
            row, direct = _receiving(stores, background, tenant, upload_id)
            # In the order of the numbers, and nothing beside them.
            found = [size for _, size in sorted(direct.received(row).items())]
            if found != part_sizes(row.length):
                accepted = f"{len(part_sizes(row.length))} parts, {row.length} bytes in total"
                raise WrongOffset("parts", f"{len(found)} parts, {sum(found)} bytes", accepted)
            # The mark of this service, which ingests it.
            stores.files.of(tenant).upload(upload_id).touch()
            background.ingest.uploads.mark_complete(upload_id)
            background.ingest.notify()
        return _record(background.ingest.uploads.get(tenant, upload_id))


def _direct(stores: Stores) -> DirectUploads:
    if stores.files.store.direct_uploads is None:
        raise NoBucket()
    return stores.files.store.direct_uploads


def _receiving(
    stores: Stores, background: Background, tenant: Tenant, upload_id: str
) -> tuple[UploadRow, DirectUploads]:
    row = background.ingest.uploads.get(tenant, upload_id)
    if row.multipart_id is None:
        raise WrongOffset("upload", f"{row.id}, sent to the service", "a direct upload")
    if row.state != "receiving":
        raise WrongOffset("state", row.state, "receiving")
    return row, _direct(stores)


def _record(row: UploadRow) -> DirectUploadRecord:
    here, record = f"/v1/direct-uploads/{row.id}", upload_record(row, 0)
    sizes = part_sizes(row.length)
    links = {**record.links, "parts": f"{here}/parts", "complete": f"{here}/complete"}
    more = {"parts": len(sizes), "part_bytes": sizes[0], "links": links}
    return DirectUploadRecord.model_validate({**record.model_dump(exclude={"offset"}), **more})

"""/v1/direct-uploads: files that clients send straight to the bucket, by presigned addresses."""

import base64
from typing import Annotated

from fastapi import APIRouter, Body, Depends, Response, status
from fastapi.openapi.models import Example

from bentray_kernels.errors import InvalidInput

from ...errors import NoBucket, WrongOffset
from ...files.direct_uploads import DirectUploads, part_sizes
from ...rows.tables import UploadRow
from ...rows.uploads import DIRECT
from ...web.errors import problems
from ...wiring import Context, RequestContext
from ..bodies import SmallBody, accept_media_types
from ..models.upload_records import (
    DirectUploadRecord,
    DirectUploadRequest,
    PartAddresses,
    PartRecord,
    PartsRequest,
)
from ..record_conversion import upload_record
from .tus import add_upload, check_length
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
    context: Context,
) -> DirectUploadRecord:
    """Create an upload; send its parts to the addresses of `parts`, then `complete` it."""
    _direct(context)
    said = {**upload.metadata, "kind": upload.kind}
    header = ",".join(f"{name} {base64.b64encode(text.encode()).decode()}" for name, text in said.items())
    what, given = read_metadata(header)
    check_length("length", upload.length, context)
    row = add_upload(context, what, upload.length, given, header)
    uploads = context.background.ingest.uploads
    uploads.change(row.id, multipart_id=DIRECT)
    record = _record(uploads.get(context.tenant, row.id))
    response.headers["Location"] = record.links["self"]
    return record


@router.post("/{upload_id}/parts", dependencies=JSON, responses=problems(400, 404, 409, 413, 415, 422, 503))
def show_parts(
    upload_id: str,
    parts: Annotated[PartsRequest, Body(openapi_examples=NUMBERS)],
    context: Context,
) -> PartAddresses:
    """Show addresses for parts, valid for an hour: PUT each, with exactly `bytes` and without a key.

    A part may be sent again. Those with the size in `received` are in the bucket.
    """
    row, direct = _receiving(context, upload_id)
    sizes = part_sizes(row.length)
    for number in parts.numbers:
        if number > len(sizes):
            raise InvalidInput("numbers", number, f"1 to {len(sizes)}")
    received = direct.received(row)
    context.background.ingest.uploads.keep(row.id, context.access.settings.upload_keep_s)
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
def complete_direct_upload(upload_id: str, context: Context) -> DirectUploadRecord:
    """Complete an upload. It is ingested in the background; poll it with `GET /v1/uploads/{id}`."""
    ingest, tenant = context.background.ingest, context.tenant
    ingest.uploads.get(tenant, upload_id)
    with ingest.locks(upload_id):
        row = ingest.uploads.get(tenant, upload_id)
        if row.multipart_id is None or row.state == "receiving":
            row, direct = _receiving(context, upload_id)
            # In the order of the numbers, and nothing beside them.
            found = [size for _, size in sorted(direct.received(row).items())]
            if found != part_sizes(row.length):
                accepted = f"{len(part_sizes(row.length))} parts, {row.length} bytes in total"
                raise WrongOffset("parts", f"{len(found)} parts, {sum(found)} bytes", accepted)
            # The mark of this service, which ingests it.
            context.stores.files.of(tenant).upload(upload_id).touch()
            ingest.uploads.change(upload_id, state="reading")
            ingest.notify()
        return _record(ingest.uploads.get(tenant, upload_id))


def _direct(context: RequestContext) -> DirectUploads:
    direct = context.stores.files.store.direct_uploads
    if direct is None:
        raise NoBucket("storage", "no bucket", "a resumable upload (/v1/uploads)")
    return direct


def _receiving(context: RequestContext, upload_id: str) -> tuple[UploadRow, DirectUploads]:
    row = context.background.ingest.uploads.get(context.tenant, upload_id)
    if row.multipart_id is None:
        raise WrongOffset("upload", f"{row.id}, sent to the service", "a direct upload")
    if row.state != "receiving":
        raise WrongOffset("state", row.state, "receiving")
    return row, _direct(context)


def _record(row: UploadRow) -> DirectUploadRecord:
    here, record = f"/v1/direct-uploads/{row.id}", upload_record(row, 0)
    sizes = part_sizes(row.length)
    links = {**record.links, "parts": f"{here}/parts", "complete": f"{here}/complete"}
    more = {"parts": len(sizes), "part_bytes": sizes[0], "links": links}
    return DirectUploadRecord.model_validate({**record.model_dump(exclude={"offset"}), **more})

"""/v1/uploads: resumable uploads by tus 1.0 (creation, checksum, expiration, termination).

A complete upload is ingested in the background. Its state changes from ``receiving`` through ``reading`` to
``done`` with the id of the result, or to ``refused`` with the problem.
"""

import shutil
from datetime import UTC, datetime
from email.utils import format_datetime
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Header, Response, status
from starlette.concurrency import run_in_threadpool

from ...errors import StorageFull, TooLarge, WrongOffset, WrongProtocol
from ...ingest.receive import ALGORITHMS, CHECKSUM, Checksum, append, received_bytes
from ...rows.tables import UploadRow
from ...web.errors import problems
from ...web.middleware import TUS_PLACE, TUS_VERSION
from ...wiring import Context, RequestContext
from ..bodies import accept_media_types
from ..models.upload_records import UploadRecord
from ..record_conversion import result_link, upload_record
from .upload_metadata import METADATA, read_metadata

MEDIA_TYPE = "application/offset+octet-stream"
EXTENSIONS = "creation,checksum,expiration,termination"

Offset = Annotated[int, Header(ge=0, le=2**63 - 1, description="Offset of the body, as HEAD returns it.")]


# tus requires 412 for another version and 400 for an unknown checksum algorithm. FastAPI would answer 422,
# so both values are validated here and only described to FastAPI.
Version = Annotated[
    str, Header(max_length=20, description="Version of tus.", json_schema_extra={"const": TUS_VERSION})
]


def check_tus_version(tus_resumable: Version) -> None:
    """A dependency that rejects other versions of tus."""
    if tus_resumable != TUS_VERSION:
        raise WrongProtocol("Tus-Resumable", repr(tus_resumable), TUS_VERSION)


router = APIRouter(prefix=TUS_PLACE, tags=["uploads"])
TusVersion = Depends(check_tus_version)
BYTES = {"schema": {"type": "string", "format": "binary"}}
BODY = {"requestBody": {"required": True, "content": {MEDIA_TYPE: BYTES}}}


@router.options("", status_code=status.HTTP_204_NO_CONTENT)
def show_upload_options(context: Context) -> Response:
    """Show the supported options of tus."""
    return Response(
        status_code=status.HTTP_204_NO_CONTENT,
        headers={
            "Tus-Extension": EXTENSIONS,
            "Tus-Max-Size": str(context.access.settings.max_upload_bytes),
            "Tus-Checksum-Algorithm": ",".join(ALGORITHMS),
        },
    )


@router.post(
    "",
    status_code=status.HTTP_201_CREATED,
    dependencies=[TusVersion],
    responses=problems(412, 413, 422, 503, 507),
)
def create_upload(
    response: Response,
    context: Context,
    upload_length: Annotated[int, Header(ge=1, le=2**63 - 1, description="Total size, bytes.")],
    upload_metadata: Annotated[
        str,
        Header(
            max_length=4000,
            description="Names with values in base 64: kind (dataset, volume or mesh; default dataset), "
            "title, and filename, the title of what has none; for volumes spacing_m, shape and dtype; for "
            "scans map and unit, separated by commas, "
            "temperature_c, sound_speed_mps and frequency_hz; other names are ignored.",
            json_schema_extra={"pattern": METADATA},
        ),
    ] = "",
) -> UploadRecord:
    """Create an upload; send its data with PATCH to the Location of the response."""
    what, given = read_metadata(upload_metadata)
    check_length("Upload-Length", upload_length, context)
    free = shutil.disk_usage(context.stores.files.root).free
    if upload_length > free:
        raise StorageFull("Upload-Length", f"{upload_length} bytes", f"at most {free} bytes, the free space")
    row = add_upload(context, what, upload_length, given, upload_metadata)
    record = upload_record(row, 0)
    response.headers["Location"] = record.links["self"]
    response.headers["Upload-Expires"] = http_date(row.expires)
    return record


@router.head("/{upload_id}", dependencies=[TusVersion], responses=problems(404, 412), include_in_schema=False)
def show_upload_offset(upload_id: str, context: Context) -> Response:
    """Show the offset and the state of an upload."""
    row = context.background.ingest.uploads.get(context.tenant, upload_id)
    headers = {
        "Upload-Offset": str(offset_of(context, row)),
        "Upload-Length": str(row.length),
        "Upload-Expires": http_date(row.expires),
        "Cache-Control": "no-store",
        "Bentray-State": row.state,
    }
    if row.sent_metadata:
        headers["Upload-Metadata"] = row.sent_metadata
    if row.state == "done":
        headers["Bentray-Result"] = result_link(row)
    return Response(headers=headers)


@router.get("/{upload_id}", responses=problems(404))
def show_upload(upload_id: str, context: Context) -> UploadRecord:
    """Show one upload: offset, state, and its result or problem."""
    row = context.background.ingest.uploads.get(context.tenant, upload_id)
    return upload_record(row, offset_of(context, row))


@router.patch(
    "/{upload_id}",
    status_code=status.HTTP_204_NO_CONTENT,
    dependencies=[TusVersion, Depends(accept_media_types(MEDIA_TYPE))],
    openapi_extra=BODY,
    responses=problems(400, 404, 408, 409, 412, 413, 415, 422, 423, 460, 507),
)
async def append_upload(
    upload_id: str,
    context: Context,
    upload_offset: Offset,
    upload_checksum: Annotated[
        str | None,
        Header(
            description="Algorithm (sha256, sha1 or md5) and digest of the body in base 64.",
            json_schema_extra={"pattern": CHECKSUM},
            examples=["sha1 Kq5sNclPz7QV2+lfQIuc6R7oRu0="],
        ),
    ] = None,
) -> Response:
    """Append data. Received data is kept if the connection breaks; HEAD returns the offset to continue from.

    A complete upload is ingested in the background; poll it with `GET`.
    """
    checksum = None if upload_checksum is None else Checksum.from_header(upload_checksum)
    request, ingest, tenant = context.request, context.background.ingest, context.tenant
    # First check the owner, so that uploads of other tenants are not reported as locked.
    await run_in_threadpool(ingest.uploads.get, tenant, upload_id)
    with ingest.locks(upload_id):
        row = await run_in_threadpool(ingest.uploads.get, tenant, upload_id)
        offset, expires = await run_in_threadpool(offset_of, context, row), row.expires
        if upload_offset != offset:
            raise WrongOffset("Upload-Offset", upload_offset, f"{offset}, of {row.length} bytes")
        if row.multipart_id is not None:
            raise WrongOffset("upload", f"{row.id}, sent to the bucket", "an upload to the service")
        if row.state == "receiving":
            length, path = row.length, context.stores.files.of(tenant).upload(upload_id)
            announced = int(request.headers.get("content-length", 0))
            if announced > length - offset:
                raise TooLarge("body", f"{announced} bytes", f"at most {length - offset} bytes")
            try:
                offset = await append(request.stream(), path, offset, length, checksum)
            finally:
                keep_s = context.access.settings.upload_keep_s
                expires = await run_in_threadpool(ingest.uploads.keep, upload_id, keep_s)
            if offset == length:
                await run_in_threadpool(ingest.uploads.change, upload_id, state="reading")
                ingest.notify()
    headers = {"Upload-Offset": str(offset), "Upload-Expires": http_date(expires)}
    return Response(status_code=status.HTTP_204_NO_CONTENT, headers=headers)


@router.delete(
    "/{upload_id}",
    status_code=status.HTTP_204_NO_CONTENT,
    dependencies=[TusVersion],
    responses=problems(404, 409, 412, 422, 423),
)
def delete_upload(upload_id: str, context: Context) -> None:
    """Delete an upload and its data; a stored result is kept."""
    ingest = context.background.ingest
    ingest.uploads.get(context.tenant, upload_id)
    with ingest.locks(upload_id):
        context.background.housekeeper.forget(ingest.uploads.get(context.tenant, upload_id))


def check_length(field: str, length: int, context: RequestContext) -> None:
    """Reject an upload that is larger than the service accepts.

    Raises:
        TooLarge: naming ``field``.
    """
    most = context.access.settings.max_upload_bytes
    if length > most:
        raise TooLarge(field, f"{length} bytes", f"at most {most} bytes (BENTRAY_MAX_UPLOAD_BYTES)")


def add_upload(
    context: RequestContext, what: str, length: int, given: dict[str, Any], header: str
) -> UploadRow:
    """Insert an upload within the rate limit and the quota, see ``Uploads.add``."""
    ingest, keep_s = context.background.ingest, context.access.settings.upload_keep_s
    ingest.upload_limits.check_begin(context.tenant)
    most_bytes = context.stores.quota.most_bytes
    return ingest.uploads.add(context.tenant, what, length, given, header, keep_s, most_bytes)


def offset_of(context: RequestContext, row: UploadRow) -> int:
    """The offset of an upload.

    Data with a checksum counts after it has been verified.
    """
    if row.state != "receiving":
        return int(row.length)
    return received_bytes(context.stores.files.of(context.tenant).upload(row.id))


def http_date(seconds: float) -> str:
    return format_datetime(datetime.fromtimestamp(seconds, UTC), usegmt=True)

"""/v1/uploads: large files in pieces, by tus 1.0 (creation, checksum, expiration, termination).

Once the last byte is there, the upload is read as a one-shot POST would be, but in the background: its
record goes from ``receiving`` over ``reading`` to ``done``, which names what it became, or ``refused``, with
the problem.
"""

from __future__ import annotations

import shutil
from datetime import UTC, datetime
from email.utils import format_datetime
from typing import Annotated

from fastapi import APIRouter, Depends, Header, Request, Response, status
from starlette.concurrency import run_in_threadpool

from ..ingest.append import ALGORITHMS, CHECKSUM, Checksum, append, received_bytes
from ..refusals import StorageFull, TooLarge, WrongOffset, WrongProtocol
from ..rows.records import UploadRow
from ..rows.tenants import Tenant
from ..web.errors import problems
from ..web.tus_headers import PLACE, VERSION
from ..wiring import CallerTenant, Parts, Service
from .bodies import accept_media_types
from .models.upload_records import UploadRecord
from .records import result_link, upload_record
from .upload_metadata import METADATA, read_metadata

MEDIA_TYPE = "application/offset+octet-stream"
EXTENSIONS = "creation,checksum,expiration,termination"

Offset = Annotated[int, Header(ge=0, le=2**63 - 1, description="Where the body begins: what HEAD says.")]


# The protocol wants 412 for another version, and 400 for a checksum of an unknown kind, where a form that
# FastAPI checks itself would be 422; so the forms of both are only described here.
Version = Annotated[
    str, Header(max_length=20, description="Of the protocol.", json_schema_extra={"const": VERSION})
]


def check_tus_version(tus_resumable: Version) -> None:
    """A dependency that refuses every other version of the protocol."""
    if tus_resumable != VERSION:
        raise WrongProtocol("Tus-Resumable", repr(tus_resumable), VERSION)


router = APIRouter(prefix=PLACE, tags=["uploads"])
TusVersion = Depends(check_tus_version)
BYTES = {"schema": {"type": "string", "format": "binary"}}
BODY = {"requestBody": {"required": True, "content": {MEDIA_TYPE: BYTES}}}


@router.options("", status_code=status.HTTP_204_NO_CONTENT)
def show_upload_options(service: Service) -> Response:
    """What of tus there is."""
    return Response(
        status_code=status.HTTP_204_NO_CONTENT,
        headers={
            "Tus-Extension": EXTENSIONS,
            "Tus-Max-Size": str(service.settings.max_upload_bytes),
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
    service: Service,
    tenant: CallerTenant,
    upload_length: Annotated[int, Header(ge=1, le=2**63 - 1, description="Of all of it, bytes.")],
    upload_metadata: Annotated[
        str,
        Header(
            max_length=4000,
            description="Names, each with its value in base 64: kind (dataset, volume or mesh; dataset "
            "without it), title, and of a volume spacing_m, shape and dtype; others are left alone.",
            json_schema_extra={"pattern": METADATA},
        ),
    ] = "",
) -> UploadRecord:
    """Begin an upload; the answer's Location is where PATCH sends the pieces."""
    what, given = read_metadata(upload_metadata)
    most = service.settings.max_upload_bytes
    if upload_length > most:
        raise TooLarge(
            "Upload-Length", f"{upload_length} bytes", f"at most {most} bytes (BENTRAY_MAX_UPLOAD_BYTES)"
        )
    free = shutil.disk_usage(service.files.root).free
    if upload_length > free:
        raise StorageFull("Upload-Length", f"{upload_length} bytes", f"at most {free} bytes, which are free")
    service.upload_limits.check_begin(tenant)
    keep_s, most_bytes = service.settings.upload_keep_s, service.quota.most_bytes
    row = service.uploads.add(tenant, what, upload_length, given, upload_metadata, keep_s, most_bytes)
    record = upload_record(row, 0)
    response.headers["Location"] = record.links["self"]
    response.headers["Upload-Expires"] = http_date(row["expires"])
    return record


@router.head("/{upload_id}", dependencies=[TusVersion], responses=problems(404, 412), include_in_schema=False)
def show_upload_offset(upload_id: str, service: Service, tenant: CallerTenant) -> Response:
    """How many bytes are there, and what has become of them."""
    row = service.uploads.get(tenant, upload_id)
    headers = {
        "Upload-Offset": str(offset_of(service, tenant, row)),
        "Upload-Length": str(row["length"]),
        "Upload-Expires": http_date(row["expires"]),
        "Cache-Control": "no-store",
        "Bentray-State": row["state"],
    }
    if row["metadata"]:
        headers["Upload-Metadata"] = row["metadata"]
    if row["state"] == "done":
        headers["Bentray-Result"] = result_link(row)
    return Response(headers=headers)


@router.get("/{upload_id}", responses=problems(404))
def show_upload(upload_id: str, service: Service, tenant: CallerTenant) -> UploadRecord:
    """One upload: how far it is, and what it became or why it was refused."""
    row = service.uploads.get(tenant, upload_id)
    return upload_record(row, offset_of(service, tenant, row))


@router.patch(
    "/{upload_id}",
    status_code=status.HTTP_204_NO_CONTENT,
    dependencies=[TusVersion, Depends(accept_media_types(MEDIA_TYPE))],
    openapi_extra=BODY,
    responses=problems(400, 404, 408, 409, 412, 413, 415, 422, 423, 460, 507),
)
async def append_upload(
    upload_id: str,
    request: Request,
    service: Service,
    tenant: CallerTenant,
    upload_offset: Offset,
    upload_checksum: Annotated[
        str | None,
        Header(
            description="sha256, sha1 or md5, and the body's in base 64.",
            json_schema_extra={"pattern": CHECKSUM},
            examples=["sha1 Kq5sNclPz7QV2+lfQIuc6R7oRu0="],
        ),
    ] = None,
) -> Response:
    """Append a piece. What came stays when the connection breaks; HEAD says where to go on.

    After the last one the upload is read in the background: `GET` of the same address tells when it is done.
    """
    checksum = None if upload_checksum is None else Checksum.of(upload_checksum)
    # Of another tenant's it must not even be told that it is held.
    await run_in_threadpool(service.uploads.get, tenant, upload_id)
    with service.hold(upload_id):
        row = await run_in_threadpool(service.uploads.get, tenant, upload_id)
        offset, expires = await run_in_threadpool(offset_of, service, tenant, row), row["expires"]
        if upload_offset != offset:
            raise WrongOffset("Upload-Offset", upload_offset, f"{offset}, of {row['length']} bytes")
        if row["state"] == "receiving":
            length, path = row["length"], service.files.of(tenant).upload(upload_id)
            announced = int(request.headers.get("content-length", 0))
            if announced > length - offset:
                raise TooLarge("body", f"{announced} bytes", f"at most {length - offset} bytes")
            try:
                offset = await append(request.stream(), path, offset, length, checksum)
            finally:
                keep_s = service.settings.upload_keep_s
                expires = await run_in_threadpool(service.uploads.keep, upload_id, keep_s)
            if offset == length:
                await run_in_threadpool(service.uploads.mark_complete, upload_id)
                service.reader.notify()
    headers = {"Upload-Offset": str(offset), "Upload-Expires": http_date(expires)}
    return Response(status_code=status.HTTP_204_NO_CONTENT, headers=headers)


@router.delete(
    "/{upload_id}",
    status_code=status.HTTP_204_NO_CONTENT,
    dependencies=[TusVersion],
    responses=problems(404, 409, 412, 422, 423),
)
def delete_upload(upload_id: str, service: Service, tenant: CallerTenant) -> None:
    """Forget an upload and what came of it; what it has become stays."""
    service.uploads.get(tenant, upload_id)
    with service.hold(upload_id):
        service.housekeeper.forget(service.uploads.get(tenant, upload_id))


def offset_of(service: Parts, tenant: Tenant, row: UploadRow) -> int:
    """How many bytes are there: the size of the file, of one that is whole its length.

    Those of a piece that is to be checked do not count before it is.
    """
    if row["state"] != "receiving":
        return int(row["length"])
    return received_bytes(service.files.of(tenant).upload(row["id"]))


def http_date(seconds: float) -> str:
    return format_datetime(datetime.fromtimestamp(seconds, UTC), usegmt=True)

"""One-shot uploads: receive the body, ingest it in a separate process, and insert its row."""

import asyncio
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, TypeVar

from fastapi import Request
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect

from ...errors import Busy
from ...ingest.canonical import make_canonical
from ...ingest.fair_queue import FairQueue
from ...ingest.ingest_process import ACCEPTED, FILE_NAME
from ...ingest.receive import check_announced, receive
from ...rows.checksums import Digest
from ...rows.ids import Tenant, new_id
from ...rows.stored_tables import UploadedTable
from ...rows.tables import DatasetRow, MeshRow, UploadedVolumeRow
from ...wiring import RequestContext
from .upload_metadata import name_of_body

# Longest wait of a request in the ingest queue, s; proxies rarely wait longer.
LONGEST_WAIT_S = 300.0

Record = TypeVar("Record", bound=DatasetRow | MeshRow | UploadedVolumeRow)
Made = TypeVar("Made")


def body_of(what: str, media_types: tuple[str, ...]) -> dict[str, Any]:
    """The body of an upload, for the OpenAPI description."""
    content = {media: {"schema": {"type": "string", "format": "binary"}} for media in media_types}
    problems = ACCEPTED[what][0].upper() + ACCEPTED[what][1:] + "."
    name = {
        "name": "Content-Disposition",
        "in": "header",
        "description": 'Name of the file, as `attachment; filename="left.h5"`: the title of what has none.',
        "schema": {"type": "string", "maxLength": 1000},
    }
    body = {"required": True, "description": problems, "content": content}
    return {"requestBody": body, "parameters": [name]}


async def receive_upload(
    context: RequestContext, table: UploadedTable[Record], given: Mapping[str, Any]
) -> Record:
    """Receive an upload and insert its row; a rejected upload leaves nothing behind.

    Args:
        context: of a request with the file as its body.
        table: of the result.
        given: metadata.
    """
    what, upload_id, tenant = table.what, new_id(table.what), context.tenant
    request, ingest, quota = context.request, context.background.ingest, context.stores.quota
    announced = request.headers.get("content-length")
    length = int(announced) if announced else None
    most = context.access.settings.max_upload_bytes
    check_announced(length, most, ACCEPTED[what])
    given = {**given, FILE_NAME: name_of_body(request.headers.get("content-disposition", ""))}
    files = context.stores.files.of(tenant)
    path = files.incoming(upload_id)
    resize = partial(quota.resize, tenant, upload_id)

    def check_and_store(received: Digest) -> Record:
        summary = make_canonical(what, path, upload_id, files, ingest.limits, given, resize)
        return table.add(tenant, upload_id, size=received.bytes, sha256=received.sha256, summary=summary)

    with ingest.upload_limits(tenant):
        async with quota.reserved(tenant, upload_id, length or 1):
            try:
                received = await receive(request.stream(), length, path, most, ACCEPTED[what], resize)
                return await run_in_turn(request, ingest.queue, tenant, partial(check_and_store, received))
            finally:
                await run_in_threadpool(path.unlink, missing_ok=True)


async def run_in_turn(request: Request, queue: FairQueue, tenant: Tenant, work: Callable[[], Made]) -> Made:
    """Run ``work`` in the ingest queue.

    Args:
        request: its body has been read; if the client disconnects, the queued work is cancelled.
        queue: of all tenants.
        tenant: whose turn is used.
        work: to run.

    Raises:
        ClientDisconnect: when the client disconnected before the work started.
        Busy: when the work did not start in ``LONGEST_WAIT_S``.
    """
    task = queue.submit(tenant, work)
    result: asyncio.Future[Made] = asyncio.wrap_future(task)
    gone = asyncio.ensure_future(request.receive())
    either: list[asyncio.Future[Any]] = [result, gone]
    try:
        await asyncio.wait(either, timeout=LONGEST_WAIT_S, return_when=asyncio.FIRST_COMPLETED)
        # Work that has started is completed.
        if result.done() or not task.cancel():
            return await result
        if gone.done():
            raise ClientDisconnect
        found = f"no turn in {LONGEST_WAIT_S:g} s, {queue.waiting(tenant)} requests of this tenant queued"
        raise Busy("uploads", found, "a later request, or a resumable upload, which is queued on the server")
    finally:
        task.cancel()
        gone.cancel()

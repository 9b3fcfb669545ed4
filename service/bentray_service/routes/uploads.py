"""How an upload comes in: received, read by a process of its own, kept as a canonical file, and stored."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import anyio
from fastapi import Request
from starlette.concurrency import run_in_threadpool

from ..access.quota import check_room
from ..ingest.canonical import Limits, make_canonical
from ..ingest.child import ACCEPTED
from ..ingest.receive import Received, receive
from ..storage.tenants import Tenant
from ..wiring import Parts

# Each ingest process may take the whole of its memory limit.
INGESTS_AT_ONCE = 2

Row = dict[str, Any]


def body_of(what: str, media_types: tuple[str, ...]) -> dict[str, Any]:
    """How OpenAPI describes the body of an upload."""
    content = {media: {"schema": {"type": "string", "format": "binary"}} for media in media_types}
    described = ACCEPTED[what][0].upper() + ACCEPTED[what][1:] + "."
    return {"requestBody": {"required": True, "description": described, "content": content}}


async def take_in(
    request: Request,
    service: Parts,
    tenant: Tenant,
    what: str,
    upload_id: str,
    store: Callable[[int, str, Row], Row],
    given: Mapping[str, Any],
) -> Row:
    """From the body of a request to a stored row; nothing is left behind when it is refused.

    Args:
        request: whose body is read.
        service: the parts of the service.
        tenant: whose upload it is.
        what: a key of ``ACCEPTED``.
        upload_id: its new id.
        store: writes the row, from the size and SHA-256 of the body and the summary of its content.
        given: what the user says of it.
    """
    announced = request.headers.get("content-length")
    files = service.files.of(tenant)
    path = files.incoming(upload_id)

    settings, most = service.settings, service.settings.max_tenant_bytes

    def check_and_store(received: Received) -> Row:
        # What came without its length being announced, or beside others, lies there by now.
        check_room(files, most, 0)
        limits = Limits(settings.ingest_memory_bytes, settings.ingest_seconds, service.files.scratch)
        summary = make_canonical(what, path, upload_id, files, limits, given)
        return store(received.size, received.sha256, summary)

    wanted = int(announced) if announced else None
    await run_in_threadpool(check_room, files, most, wanted or 1)
    try:
        received = await receive(
            request.stream(),
            wanted,
            path,
            settings.max_upload_bytes,
            ACCEPTED[what],
        )
        limiter: anyio.CapacityLimiter = request.app.state.ingest_limiter
        return await anyio.to_thread.run_sync(check_and_store, received, limiter=limiter)
    finally:
        await run_in_threadpool(path.unlink, missing_ok=True)

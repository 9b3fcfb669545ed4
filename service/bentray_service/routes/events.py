"""/v1/jobs/{id}/events: what happens to a job, as server-sent events."""

from __future__ import annotations

import json
import time
from collections.abc import AsyncIterator
from datetime import UTC, datetime
from typing import Annotated, Any

from fastapi import APIRouter, Header, Response
from fastapi.responses import StreamingResponse
from starlette.types import Receive, Scope, Send

from ..jobs.feed import EventFeed, WatchedJob
from ..rows.schema import ENDED
from ..rows.tenants import Tenant
from ..web.errors import problems
from ..wiring import CallerTenant, Service

router = APIRouter(prefix="/v1/jobs", tags=["jobs"])

# A comment after so much silence keeps proxies from closing the connection.
SILENCE_SECONDS = 15.0

MEDIA_TYPE = "text/event-stream"


@router.get(
    "/{job_id}/events",
    response_class=StreamingResponse,
    responses={
        200: {"content": {MEDIA_TYPE: {}}, "description": "The events."},
        **problems(404, 422, 429),
    },
)
def job_events(
    job_id: str,
    service: Service,
    tenant: CallerTenant,
    last_event_id: Annotated[
        int, Header(ge=0, le=2**63 - 1, description="Only later events; a browser sends it by itself.")
    ] = 0,
) -> Response:
    """What happens to a job, as it happens; it ends with the job.

    Events `state` are the changes of its state, each with an id that only grows; between them events
    `progress`, without an id, tell how far it is. A tenant may have 64 such streams open; a further one is
    refused with 429.
    """
    service.jobs.get(tenant, job_id)
    return _Stream(service.feed, tenant, job_id, last_event_id)


class _Stream(Response):
    """The answer; its place among the streams is taken when it begins and given back however it ends."""

    def __init__(self, feed: EventFeed, tenant: Tenant, job_id: str, last: int) -> None:
        super().__init__(media_type=MEDIA_TYPE)
        self._feed = feed
        self._of = tenant, job_id
        self._last = last

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        with self._feed.watch(*self._of) as job:
            told = _told(self._feed, job, self._last)
            stream = StreamingResponse(told, media_type=MEDIA_TYPE, headers={"Cache-Control": "no-store"})
            await stream(scope, receive, send)


async def _told(feed: EventFeed, job: WatchedJob, last: int) -> AsyncIterator[str]:
    told: dict[str, Any] = {}
    spoken = time.monotonic()
    while not feed.leaving() and not job.gone:
        said = []
        for event in job.events:
            if event["number"] > last:
                last = event["number"]
                at = datetime.fromtimestamp(event["time"], UTC).isoformat()
                said.append(
                    _event("state", {"state": event["state"], "note": event["note"], "time": at}, last)
                )
        row = job.row or {"state": "", "done": 0, "total": 0, "phase": ""}
        progress = {"done": row["done"], "total": row["total"], "phase": row["phase"] or ""}
        if row["state"] == "running" and row["total"] and progress != told:
            said.append(_event("progress", progress))
            told = progress
        if not said and time.monotonic() - spoken > SILENCE_SECONDS:
            said.append(": nothing new\n\n")
        if said:
            spoken = time.monotonic()
            yield "".join(said)
        elif row["state"] in ENDED:
            return
        else:
            await job.wait_for_change(SILENCE_SECONDS)


def _event(name: str, data: dict[str, Any], number: int | None = None) -> str:
    """One event in the form of the standard; JSON has no line breaks of its own."""
    numbered = "" if number is None else f"id: {number}\n"
    return f"{numbered}event: {name}\ndata: {json.dumps(data)}\n\n"

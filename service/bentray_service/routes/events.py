"""/v1/jobs/{id}/events: state and progress of a job as server-sent events."""

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

# Interval between comments that keep proxies from closing an idle connection, s.
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
        int, Header(ge=0, le=2**63 - 1, description="Only later events; set by browsers automatically.")
    ] = 0,
) -> Response:
    """Stream the events of a job until it ends.

    `state` events are changes of state with increasing ids; `progress` events have no id. A tenant may have
    64 open streams; further ones are rejected with 429.
    """
    service.jobs.get(tenant, job_id)
    return _Stream(service.feed, tenant, job_id, last_event_id)


class _Stream(Response):
    """The response; it holds its place among the open streams while it is sent."""

    def __init__(self, feed: EventFeed, tenant: Tenant, job_id: str, last: int) -> None:
        super().__init__(media_type=MEDIA_TYPE)
        self._feed = feed
        self._of = tenant, job_id
        self._last = last

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        with self._feed.watch(*self._of) as job:
            sent = _generate(self._feed, job, self._last)
            stream = StreamingResponse(sent, media_type=MEDIA_TYPE, headers={"Cache-Control": "no-store"})
            await stream(scope, receive, send)


async def _generate(feed: EventFeed, job: WatchedJob, last: int) -> AsyncIterator[str]:
    sent: dict[str, Any] = {}
    spoken = time.monotonic()
    while not feed.leaving() and not job.gone:
        messages = []
        for event in job.events:
            if event["number"] > last:
                last = event["number"]
                at = datetime.fromtimestamp(event["time"], UTC).isoformat()
                messages.append(
                    _event("state", {"state": event["state"], "note": event["note"], "time": at}, last)
                )
        row = job.row or {"state": "", "done": 0, "total": 0, "phase": ""}
        progress = {"done": row["done"], "total": row["total"], "phase": row["phase"] or ""}
        if row["state"] == "running" and row["total"] and progress != sent:
            messages.append(_event("progress", progress))
            sent = progress
        if not messages and time.monotonic() - spoken > SILENCE_SECONDS:
            messages.append(": keep-alive\n\n")
        if messages:
            spoken = time.monotonic()
            yield "".join(messages)
        elif row["state"] in ENDED:
            return
        else:
            await job.wait_for_change(SILENCE_SECONDS)


def _event(name: str, data: dict[str, Any], number: int | None = None) -> str:
    """One server-sent event with a JSON object as data."""
    numbered = "" if number is None else f"id: {number}\n"
    return f"{numbered}event: {name}\ndata: {json.dumps(data)}\n\n"

"""/v1/jobs/{id}/events and /v1/events: state and progress of jobs as server-sent events."""

import json
import time
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractContextManager
from datetime import UTC, datetime
from typing import Annotated, Any, Generic, TypeVar

from fastapi import APIRouter, Header, Query, Response
from fastapi.responses import StreamingResponse
from starlette.types import Receive, Scope, Send

from ..jobs.feed import EventFeed, Watched, WatchedJob, WatchedTenant
from ..rows.jobs import JobProgress
from ..rows.tables import ENDED
from ..web.errors import problems
from ..wiring import Context

router = APIRouter(prefix="/v1", tags=["jobs"])

# Interval between comments that keep proxies from closing an idle connection, s.
SILENCE_SECONDS = 15.0

KEEP_ALIVE = ": keep-alive\n\n"

MEDIA_TYPE = "text/event-stream"
STREAM = {"content": {MEDIA_TYPE: {}}, "description": "The events."}

Seen = TypeVar("Seen", bound=Watched)


@router.get("/events", response_class=StreamingResponse, responses={200: STREAM, **problems(404, 422, 429)})
def all_events(
    context: Context,
    seconds: Annotated[int, Query(ge=1, le=3600, description="The stream ends after this time, s.")] = 600,
) -> Response:
    """Stream the changes of all jobs: first one event for each unfinished job, then one for each change.

    A `job` event has the id, the state and the progress of a job. The limits are those of the events of one
    job.
    """
    feed, end = context.background.feed, time.monotonic() + seconds
    return _Stream(lambda: feed.watch_tenant(context.tenant), lambda jobs: _of_tenant(feed, jobs, end))


@router.get(
    "/jobs/{job_id}/events",
    response_class=StreamingResponse,
    responses={200: STREAM, **problems(404, 422, 429)},
)
def job_events(
    job_id: str,
    context: Context,
    last_event_id: Annotated[
        int, Header(ge=0, le=2**63 - 1, description="Only later events; set by browsers automatically.")
    ] = 0,
) -> Response:
    """Stream the events of a job until it ends.

    `state` events are changes of state with increasing ids; `progress` events have no id. A tenant may have
    64 open streams; further ones are rejected with 429.
    """
    context.stores.jobs.get(context.tenant, job_id)
    feed = context.background.feed
    return _Stream(lambda: feed.watch(context.tenant, job_id), lambda job: _of_job(feed, job, last_event_id))


class _Stream(Response, Generic[Seen]):
    """The response; it holds its place among the open streams while it is sent."""

    def __init__(
        self,
        watch: Callable[[], AbstractContextManager[Seen]],
        generate: Callable[[Seen], AsyncIterator[str]],
    ) -> None:
        super().__init__(media_type=MEDIA_TYPE)
        self._watch = watch
        self._generate = generate

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        with self._watch() as watched:
            sent = self._generate(watched)
            stream = StreamingResponse(sent, media_type=MEDIA_TYPE, headers={"Cache-Control": "no-store"})
            await stream(scope, receive, send)


async def _of_tenant(feed: EventFeed, jobs: WatchedTenant, end: float) -> AsyncIterator[str]:
    last, spoken = 0, time.monotonic()
    while not feed.leaving():
        last, rows = jobs.since(last)
        if rows:
            yield "".join(_event("job", _progress_of(row)) for row in rows)
        elif time.monotonic() >= end:
            return
        elif time.monotonic() - spoken > SILENCE_SECONDS:
            yield KEEP_ALIVE
        else:
            await jobs.wait_for_change(min(SILENCE_SECONDS, max(0.0, end - time.monotonic())))
            continue
        spoken = time.monotonic()


def _progress_of(row: JobProgress) -> dict[str, Any]:
    progress = {"done": row.done, "total": row.total, "phase": row.phase or ""}
    return {"id": row.id, "state": row.state, "progress": progress}


async def _of_job(feed: EventFeed, job: WatchedJob, last: int) -> AsyncIterator[str]:
    sent: dict[str, Any] = {}
    spoken = time.monotonic()
    while not feed.leaving() and not job.gone:
        messages = []
        for event in job.events:
            if event.number > last:
                last = event.number
                at = datetime.fromtimestamp(event.time, UTC).isoformat()
                messages.append(_event("state", {"state": event.state, "note": event.note, "time": at}, last))
        row = job.row or JobProgress("", "", 0, 0, "")
        progress = _progress_of(row)["progress"]
        if row.state == "running" and row.total and progress != sent:
            messages.append(_event("progress", progress))
            sent = progress
        if not messages and time.monotonic() - spoken > SILENCE_SECONDS:
            messages.append(KEEP_ALIVE)
        if messages:
            spoken = time.monotonic()
            yield "".join(messages)
        elif row.state in ENDED:
            return
        else:
            await job.wait_for_change(SILENCE_SECONDS)


def _event(name: str, data: dict[str, Any], number: int | None = None) -> str:
    """One server-sent event with a JSON object as data."""
    numbered = "" if number is None else f"id: {number}\n"
    return f"{numbered}event: {name}\ndata: {json.dumps(data)}\n\n"

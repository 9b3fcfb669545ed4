"""/v1/jobs/{id}/events: what happens to a job, as server-sent events."""

from __future__ import annotations

import json
import time
from collections.abc import AsyncIterator, Callable
from datetime import UTC, datetime
from typing import Annotated, Any

import anyio
from fastapi import APIRouter, Header, Request
from fastapi.responses import StreamingResponse
from starlette.concurrency import run_in_threadpool

from ..errors import described
from ..storage.jobs import Jobs
from ..storage.schema import ENDED
from ..storage.tenants import Tenant
from ..wiring import CallerTenant, Service

router = APIRouter(prefix="/v1/jobs", tags=["jobs"])

# How often the database is asked.
INTERVAL_SECONDS = 0.5
# A comment after so much silence keeps proxies from closing the connection.
SILENCE_SECONDS = 15.0

MEDIA_TYPE = "text/event-stream"


@router.get(
    "/{job_id}/events",
    response_class=StreamingResponse,
    responses={200: {"content": {MEDIA_TYPE: {}}, "description": "The events."}, **described(404, 422)},
)
def job_events(
    job_id: str,
    request: Request,
    service: Service,
    tenant: CallerTenant,
    last_event_id: Annotated[
        int, Header(ge=0, le=2**63 - 1, description="Only later events; a browser sends it by itself.")
    ] = 0,
) -> StreamingResponse:
    """What happens to a job, as it happens; it ends with the job.

    Events `state` are the changes of its state, each with an id that only grows; between them events
    `progress`, without an id, tell how far it is.
    """
    service.jobs.get(tenant, job_id)
    leaving = request.app.state.leaving
    stream = _stream(service.jobs, tenant, job_id, last_event_id, leaving.is_set)
    return StreamingResponse(stream, media_type=MEDIA_TYPE, headers={"Cache-Control": "no-store"})


async def _stream(
    jobs: Jobs, tenant: Tenant, job_id: str, last: int, leaving: Callable[[], bool]
) -> AsyncIterator[str]:
    told: dict[str, Any] = {}
    spoken = time.monotonic()
    while not leaving():
        # The job first: an event that comes in between is told next time, never left out at the end.
        job = await run_in_threadpool(jobs.get, tenant, job_id)
        said = []
        for event in await run_in_threadpool(jobs.events, tenant, job_id, after=last):
            last = event["number"]
            at = datetime.fromtimestamp(event["time"], UTC).isoformat()
            said.append(_event("state", {"state": event["state"], "note": event["note"], "time": at}, last))
        progress = {"done": job["done"], "total": job["total"], "phase": job["phase"] or ""}
        if job["state"] == "running" and job["total"] and progress != told:
            said.append(_event("progress", progress))
            told = progress
        if not said and time.monotonic() - spoken > SILENCE_SECONDS:
            said.append(": nothing new\n\n")
        if said:
            spoken = time.monotonic()
            yield "".join(said)
        elif job["state"] in ENDED:
            return
        if job["state"] not in ENDED:
            await anyio.sleep(INTERVAL_SECONDS)


def _event(name: str, data: dict[str, Any], number: int | None = None) -> str:
    """One event in the form of the standard; JSON has no line breaks of its own."""
    numbered = "" if number is None else f"id: {number}\n"
    return f"{numbered}event: {name}\ndata: {json.dumps(data)}\n\n"

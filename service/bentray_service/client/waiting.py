"""The flow of waiting for a job: by its events where they come through, else by looking now and then."""

from __future__ import annotations

import time
from collections.abc import Callable

from ..routes.models.records import JobRecord
from .errors import ClientError, from_problem
from .steps import EventStep, Flow, PauseStep, RequestStep

# The service says something at least every 15 s; a proxy that keeps events back never does.
SILENCE_S = 40.0
# A stream that breaks so often is not tried again.
STREAMS = 3


def wait_for(
    job_id: str, on_progress: Callable[[JobRecord], None] | None, timeout_s: float | None, poll_s: float
) -> Flow[JobRecord]:
    """Wait until a job has succeeded; its value is the record of the job."""
    deadline = None if timeout_s is None else time.monotonic() + timeout_s
    place, broken = f"/v1/jobs/{job_id}", 0
    while True:
        answer = yield RequestStep("GET", place, repeatable=True, until=deadline)
        job = JobRecord.model_validate_json(answer.content)
        if on_progress is not None:
            on_progress(job)
        if job.state == "succeeded":
            return job
        if job.state == "failed":
            raise from_problem(job.error)
        if job.state == "cancelled":
            raise ClientError(f"{job_id} was cancelled")
        if deadline is not None and time.monotonic() > deadline:
            raise ClientError(f"{job_id} is still {job.state} after {timeout_s:g} s")
        if broken < STREAMS:
            left = SILENCE_S if deadline is None else deadline - time.monotonic()
            try:
                if not (yield from _news(f"{place}/events", max(poll_s, min(SILENCE_S, left)), deadline)):
                    broken += 1
                else:
                    broken = 0
                continue
            except ClientError:
                broken += 1
        yield PauseStep(poll_s)


def _news(place: str, seconds: float, deadline: float | None) -> Flow[bool]:
    """Wait for an event or for the deadline; false when the stream has ended, as it does with the job."""
    while deadline is None or time.monotonic() <= deadline:
        line = yield EventStep(place, seconds)
        if line is None:
            return False
        if line.startswith("data:"):
            break
    return True

"""The flow that waits for a job, by its event stream or by polling."""

from __future__ import annotations

import time
from collections.abc import Callable

from ..routes.models.job_records import JobRecord
from .errors import ClientError, from_problem
from .steps import EventStep, Flow, PauseStep, RequestStep

# Time limit for a line of the event stream, s; the service sends one at least every 15 s.
SILENCE_S = 40.0
# Number of broken event streams before polling.
STREAMS = 3


def wait_for(
    job_id: str, on_progress: Callable[[JobRecord], None] | None, timeout_s: float | None, poll_s: float
) -> Flow[JobRecord]:
    """Wait until a job has succeeded; the result is its record."""
    deadline = None if timeout_s is None else time.monotonic() + timeout_s
    path, broken = f"/v1/jobs/{job_id}", 0
    while True:
        response = yield RequestStep("GET", path, repeatable=True, until=deadline)
        job = JobRecord.model_validate_json(response.content)
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
                if not (
                    yield from _wait_event(f"{path}/events", max(poll_s, min(SILENCE_S, left)), deadline)
                ):
                    broken += 1
                else:
                    broken = 0
                continue
            except ClientError:
                broken += 1
        yield PauseStep(poll_s)


def _wait_event(path: str, seconds: float, deadline: float | None) -> Flow[bool]:
    """Wait for an event or the deadline; False at the end of the stream."""
    while deadline is None or time.monotonic() <= deadline:
        line = yield EventStep(path, seconds)
        if line is None:
            return False
        if line.startswith("data:"):
            break
    return True

"""Flows that wait: for a job, by its event stream or by polling, and for a batch."""

from __future__ import annotations

import time
from collections.abc import Callable

from ..interactive.progress_bar import phase_note, progress_bar
from ..routes.models.batch_records import BatchRecord
from ..routes.models.job_records import JobRecord
from .connection import Connection, EventStep, Flow, PauseStep, RequestStep
from .errors import ClientError, from_problem
from .lists import BatchId, JobId, id_of

# Time limit for a line of the event stream, s; the service sends one at least every 15 s.
SILENCE_S = 40.0
# Number of broken event streams before polling.
STREAMS = 3
ENDED = ("succeeded", "failed", "cancelled")
# Parts of a progress bar of a batch.
PARTS = 1000


def wait(
    connection: Connection,
    job: JobId,
    on_progress: Callable[[JobRecord], None] | None = None,
    timeout_s: float | None = None,
    *,
    progress: bool = False,
) -> Flow[JobRecord]:
    """Wait until a job has succeeded and return its record.

    Args:
        job: id or record.
        on_progress: called with every record.
        timeout_s: time limit, s; None: none.
        progress: show a progress bar.

    Raises:
        ClientError: when the job failed or was cancelled, or after ``timeout_s``.
    """
    words = "Waiting" if isinstance(job, str) else job.kind.replace("-", " ").capitalize()
    deadline = None if timeout_s is None else time.monotonic() + timeout_s
    path, broken = f"/v1/jobs/{id_of(job)}", 0
    with progress_bar(words, shown=progress) as step:
        while True:
            response = yield RequestStep("GET", path, repeatable=True, until=deadline)
            record = JobRecord.model_validate_json(response.content)
            step(
                record.progress.done, record.progress.total, phase_note(record.progress.phase) or record.state
            )
            if on_progress is not None:
                on_progress(record)
            if record.state == "succeeded":
                return record
            if record.state == "failed":
                raise from_problem(record.error)
            if record.state == "cancelled":
                raise ClientError(f"{id_of(job)} was cancelled")
            _check_deadline(record, deadline, timeout_s)
            if broken < STREAMS:
                left = SILENCE_S if deadline is None else deadline - time.monotonic()
                seconds = max(connection.poll_s, min(SILENCE_S, left))
                try:
                    event = yield from _wait_event(f"{path}/events", seconds, deadline)
                    broken = 0 if event else broken + 1
                    continue
                except ClientError:
                    broken += 1
            yield PauseStep(connection.poll_s)


def wait_batch(
    connection: Connection,
    batch: BatchId,
    on_progress: Callable[[BatchRecord], None] | None = None,
    timeout_s: float | None = None,
    *,
    progress: bool = False,
) -> Flow[BatchRecord]:
    """Wait until all jobs of a batch have ended, and return its record; its state says whether all succeeded.

    Args:
        batch: id or record.
        on_progress: called with every record.
        timeout_s: time limit, s; None: none.
        progress: show a progress bar.

    Raises:
        ClientError: after ``timeout_s``.
    """
    deadline = None if timeout_s is None else time.monotonic() + timeout_s
    path = f"/v1/batches/{id_of(batch)}"
    with progress_bar("Batch", shown=progress) as step:
        while True:
            response = yield RequestStep("GET", path, repeatable=True, until=deadline)
            record = BatchRecord.model_validate_json(response.content)
            step(int(PARTS * record.progress), PARTS, words_of(record))
            if on_progress is not None:
                on_progress(record)
            if record.state in ENDED:
                return record
            _check_deadline(record, deadline, timeout_s)
            yield PauseStep(connection.poll_s)


def words_of(batch: BatchRecord) -> str:
    """The jobs in each state, as ``3 succeeded, 1 running``."""
    order = ("succeeded", "failed", "cancelled", "cancelling", "running", "queued")
    return ", ".join(f"{batch.counts[state]} {state}" for state in order if batch.counts.get(state))


def _check_deadline(record: JobRecord | BatchRecord, deadline: float | None, timeout_s: float | None) -> None:
    if deadline is not None and time.monotonic() > deadline:
        raise ClientError(f"{record.id} is still {record.state} after {timeout_s:g} s")


def _wait_event(path: str, seconds: float, deadline: float | None) -> Flow[bool]:
    """Wait for an event or the deadline; False at the end of the stream."""
    while deadline is None or time.monotonic() <= deadline:
        line = yield EventStep(path, seconds)
        if line is None:
            return False
        if line.startswith("data:"):
            break
    return True

"""Flows of batches: reconstructions of many scans with one progress."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Unpack

from ..html_tables import RecordList
from ..interactive.progress_bar import progress_bar
from ..routes.models.batch_records import BatchList, BatchRecord
from .connection import Connection
from .errors import ClientError
from .flows import merged_settings
from .lists import LIMIT, get
from .steps import Flow, PauseStep, RequestStep
from .stored import BatchId, DatasetId, id_of

if TYPE_CHECKING:
    from ..interactive.setting_types import Method, ReconstructionSettings

ENDED = ("succeeded", "failed", "cancelled")
# Parts of a progress bar.
PARTS = 1000


def submit_batch(
    connection: Connection,
    datasets: Sequence[DatasetId],
    settings: Mapping[str, Any] | None = None,
    *,
    name: str = "",
    method: Method | None = None,
    **values: Unpack[ReconstructionSettings],
) -> Flow[BatchRecord]:
    """Start one reconstruction for each dataset, as one batch; omitted settings take their defaults.

    Args:
        datasets: ids or records, at most 1000.
        settings: as the REST interface has them.
        name: of the batch.
        method, values: as for ``bentray.reconstruct``, in place of those of ``settings``.
    """
    request = {
        "datasets": [id_of(one) for one in datasets],
        "name": name,
        "settings": merged_settings(settings, method, {**values}),
    }
    options = {"json": request, "headers": {"Idempotency-Key": str(uuid.uuid4())}}
    response = yield RequestStep("POST", "/v1/batches", options, repeatable=True)
    return BatchRecord.model_validate_json(response.content)


def batch(connection: Connection, batch: BatchId) -> Flow[BatchRecord]:
    """Get the current record of a batch."""
    return (yield from get(BatchRecord, f"/v1/batches/{id_of(batch)}"))


def batches(connection: Connection, limit: int = 100) -> Flow[RecordList[BatchRecord]]:
    """List the newest batches, at most 1000."""
    LIMIT.check("limit", limit)
    found = yield from get(BatchList, "/v1/batches", {"limit": limit})
    return RecordList(found.batches)


def cancel_batch(connection: Connection, batch: BatchId) -> Flow[BatchRecord]:
    """Cancel the jobs of a batch that have not ended."""
    response = yield RequestStep("POST", f"/v1/batches/{id_of(batch)}/cancel")
    return BatchRecord.model_validate_json(response.content)


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
    place = f"/v1/batches/{id_of(batch)}"
    with progress_bar("Batch", shown=progress) as step:
        while True:
            response = yield RequestStep("GET", place, repeatable=True, until=deadline)
            found = BatchRecord.model_validate_json(response.content)
            step(int(PARTS * found.progress), PARTS, words_of(found))
            if on_progress is not None:
                on_progress(found)
            if found.state in ENDED:
                return found
            if deadline is not None and time.monotonic() > deadline:
                raise ClientError(f"{found.id} is still {found.state} after {timeout_s:g} s")
            yield PauseStep(connection.poll_s)


def words_of(batch: BatchRecord) -> str:
    """The jobs in each state, as ``3 succeeded, 1 running``."""
    order = ("succeeded", "failed", "cancelled", "cancelling", "running", "queued")
    return ", ".join(f"{batch.counts[state]} {state}" for state in order if batch.counts.get(state))

"""/v1/batches: reconstruct many scans, with one progress; cancel and delete them together."""

import logging
from typing import Annotated, Literal

from fastapi import APIRouter, Body, Depends, Response, status
from fastapi.openapi.models import Example

from bentray_kernels.errors import InvalidInput

from ..errors import InUse
from ..jobs.kinds import KINDS, ReconstructionRequest
from ..rows.tables import ENDED
from ..web.errors import problems
from ..wiring import Context
from .bodies import IdempotencyKey, Limit, SmallBody, accept_media_types, answer_made
from .models.batch_records import BatchList, BatchRecord, BatchRequest
from .record_conversion import batch_record

log = logging.getLogger("bentray.jobs")

KIND: Literal["reconstruction"] = "reconstruction"
EXAMPLES: dict[str, Example] = {
    "batch": {
        "summary": "Two scans with the same settings",
        "value": {
            "datasets": ["ds-0123456789abcdef0123", "ds-abcdef01234567890123"],
            "name": "Ward 3",
            "settings": {"nodes": 128, "rays": "curved"},
        },
    }
}

router = APIRouter(prefix="/v1/batches", tags=["batches"], route_class=SmallBody)


@router.post(
    "",
    status_code=status.HTTP_202_ACCEPTED,
    dependencies=[Depends(accept_media_types("application/json"))],
    responses=problems(400, 404, 409, 413, 415, 422, 429, 503, 507),
)
def start_batch(
    batch_request: Annotated[BatchRequest, Body(openapi_examples=EXAMPLES)],
    response: Response,
    context: Context,
    idempotency_key: IdempotencyKey = None,
) -> BatchRecord:
    """Queue one reconstruction for each dataset. All are stored before the response, or none."""
    datasets, settings, background = batch_request.datasets, batch_request.settings, context.background
    if len(set(datasets)) < len(datasets):
        twice = next(one for one in datasets if datasets.count(one) > 1)
        raise InvalidInput("datasets", f"{twice[:80]} twice", "each dataset once")
    new = []
    for dataset in datasets:
        one = ReconstructionRequest(kind=KIND, dataset=dataset, settings=settings)
        new.append(KINDS[KIND].plan(one, context.tenant, context.stores, background.runner.compute))
    background.webhooks.check(context.tenant, batch_request.webhook)
    how = context.submission(idempotency_key, batch_request.webhook)
    batches = context.stores.batches
    row = batches.add(context.tenant, batch_request.name, settings.to_dict(), new, how)
    log.info("%s queued, %d jobs", row.id, row.size, extra={"figures": {"batch": row.id}})
    background.runner.notify(row.id)
    batch = batch_record(row)
    answer_made(response, batch.links["self"], replayed=row.replayed)
    return batch


@router.get("", responses=problems(422))
def list_batches(context: Context, limit: Limit = 100) -> BatchList:
    """List batches, newest first."""
    rows = context.stores.batches.newest(context.tenant, limit)
    return BatchList(batches=[batch_record(row) for row in rows])


@router.get("/{batch_id}", responses=problems(404))
def show_batch(batch_id: str, context: Context) -> BatchRecord:
    """Show one batch: state, progress and jobs."""
    return batch_record(context.stores.batches.get(context.tenant, batch_id))


@router.post("/{batch_id}/cancel", status_code=status.HTTP_202_ACCEPTED, responses=problems(404, 409))
def cancel_batch(batch_id: str, context: Context) -> BatchRecord:
    """Cancel the jobs that have not ended; results of the others stay."""
    return batch_record(context.stores.batches.request_cancel(context.tenant, batch_id))


@router.delete("/{batch_id}", status_code=status.HTTP_204_NO_CONTENT, responses=problems(404, 409, 503))
def delete_batch(batch_id: str, context: Context) -> None:
    """Delete a batch that has ended, with its jobs and their volumes; the scans stay.

    If the service dies in between, the remaining jobs keep the batch, and it can be deleted again.
    """
    batch = context.stores.batches.get(context.tenant, batch_id)
    busy = next((job for job in batch.jobs if job.state not in ENDED), None)
    if busy is not None:
        raise InUse("batch", f"{batch.id} with {busy.id} ({busy.state})", "a batch that has ended")
    for job in batch.jobs:
        context.delete("job", job.id)

"""PATCH of /v1/datasets and /v1/jobs: names, notes and stated water; and corrected copies of scans."""

from __future__ import annotations

from functools import partial
from typing import Annotated, Any

from fastapi import APIRouter, Body, Depends, Request, Response, status
from fastapi.openapi.models import Example
from starlette.concurrency import run_in_threadpool

from bentray_workers.files.dataset.correct import Correction

from ..ingest.canonical import IngestLimits, add_corrected
from ..rows.ids import Tenant, new_id
from ..rows.stored_tables import RequestKey
from ..rows.tables import DatasetRow
from ..web.errors import problems
from ..wiring import Access, Background, CallerTenant, Stores
from .bodies import IdempotencyKey, SmallBody, accept_media_types, answer_made
from .models.job_records import DatasetRecord, JobRecord
from .models.name_changes import DatasetChanges, JobChanges, ScanCorrection
from .record_conversion import dataset_record, job_record
from .uploads.one_shot_uploads import run_in_turn

JSON = [Depends(accept_media_types("application/json"))]
REFUSALS = problems(400, 404, 413, 415, 422)
OF_A_SCAN: dict[str, Example] = {
    "named": {"value": {"title": "Left breast", "notes": "Second visit.", "water_temperature_c": 31.2}}
}
CORRECTIONS: dict[str, Example] = {
    "times": {
        "summary": "Milliseconds were read as microseconds",
        "value": {"times_in": "ms", "times_read_as": "us"},
    },
    "positions": {
        "summary": "Millimetres were read as centimetres; another frequency",
        "value": {"positions_in": "mm", "positions_read_as": "cm", "frequency_hz": 500000},
    },
}
OF_A_JOB: dict[str, Example] = {"named": {"value": {"name": "With the new water speed"}}}

router = APIRouter(prefix="/v1", route_class=SmallBody)


@router.patch(
    "/datasets/{dataset_id}",
    tags=["datasets"],
    dependencies=JSON,
    responses=REFUSALS,
)
def change_dataset(
    dataset_id: str,
    changes: Annotated[DatasetChanges, Body(openapi_examples=OF_A_SCAN)],
    stores: Stores,
    tenant: CallerTenant,
) -> DatasetRecord:
    """Change the name, the notes or the stated water of a scan; its file stays as it is."""
    words = {"name": changes.title, "notes": changes.notes}
    given: dict[str, str | float | None] = {k: value for k, value in words.items() if value is not None}
    if "water_temperature_c" in changes.model_fields_set:
        given["water_temperature_c"] = changes.water_temperature_c
    return dataset_record(stores.datasets.describe(tenant, dataset_id, **given))


@router.post(
    "/datasets/{dataset_id}/corrections",
    tags=["datasets"],
    status_code=status.HTTP_201_CREATED,
    dependencies=JSON,
    responses=problems(400, 404, 409, 413, 415, 422, 503, 507),
)
async def correct_dataset(
    dataset_id: str,
    correction: Annotated[ScanCorrection, Body(openapi_examples=CORRECTIONS)],
    request: Request,
    response: Response,
    stores: Stores,
    background: Background,
    access: Access,
    tenant: CallerTenant,
    idempotency_key: IdempotencyKey = None,
) -> DatasetRecord:
    """Make a corrected copy of a scan whose units, sampling rate or frequency were stated wrongly.

    The copy passes the checks of an upload and is a scan of its own. The scan itself stays as it is, since
    its reconstructions were made of it; delete it when they are no longer needed.
    """
    given = correction.model_dump(exclude_none=True)
    # A correction that changes nothing is rejected before any work.
    Correction(**given)
    key = RequestKey.from_header(idempotency_key, ["correction", dataset_id, given])
    made = await run_in_threadpool(stores.datasets.made_by, tenant, key)
    if made is None:
        made = await _corrected(dataset_id, given, key, request, stores, background, access, tenant)
    record = dataset_record(made)
    answer_made(response, record.links["self"], replayed=made.replayed)
    return record


async def _corrected(
    dataset_id: str,
    given: dict[str, Any],
    key: RequestKey,
    request: Request,
    stores: Stores,
    background: Background,
    access: Access,
    tenant: Tenant,
) -> DatasetRow:
    """The row of a corrected copy, which is made in the ingest queue."""
    scan = await run_in_threadpool(stores.datasets.get, tenant, dataset_id)
    copy_id, settings, files = new_id("dataset"), access.settings, stores.files.of(tenant)
    reserve = partial(stores.quota.resize, tenant, copy_id)
    limits = IngestLimits(settings.ingest_memory_bytes, settings.ingest_seconds, stores.files.scratch)

    def work() -> DatasetRow:
        stores.files.store.fetch(files.dataset(scan.id))
        return add_corrected(tenant, scan, given, key, copy_id, stores.datasets, files, limits, reserve)

    with background.ingest.upload_limits(tenant):
        async with stores.quota.reserved(tenant, copy_id, scan.bytes):
            return await run_in_turn(request, background.ingest.queue, tenant, work)


@router.patch("/jobs/{job_id}", tags=["jobs"], dependencies=JSON, responses=REFUSALS)
def change_job(
    job_id: str,
    changes: Annotated[JobChanges, Body(openapi_examples=OF_A_JOB)],
    stores: Stores,
    tenant: CallerTenant,
) -> JobRecord:
    """Change the name or the notes of a job in any state."""
    row = stores.jobs.describe(tenant, job_id, **changes.model_dump(exclude_none=True))
    return job_record(row, stores.jobs.place(row))

"""PATCH of /v1/datasets and /v1/jobs: names, notes and stated water."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Body, Depends
from fastapi.openapi.models import Example

from ..web.errors import problems
from ..wiring import CallerTenant, Service
from .bodies import SmallBody, accept_media_types
from .models.job_records import DatasetRecord, JobRecord
from .models.name_changes import DatasetChanges, JobChanges
from .record_conversion import dataset_record, job_record

JSON = [Depends(accept_media_types("application/json"))]
REFUSALS = problems(400, 404, 413, 415, 422)
OF_A_SCAN: dict[str, Example] = {
    "named": {"value": {"title": "Left breast", "notes": "Second visit.", "water_temperature_c": 31.2}}
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
    service: Service,
    tenant: CallerTenant,
) -> DatasetRecord:
    """Change the name, the notes or the stated water of a scan; its file stays as it is."""
    words = {"name": changes.title, "notes": changes.notes}
    given: dict[str, str | float | None] = {k: value for k, value in words.items() if value is not None}
    if "water_temperature_c" in changes.model_fields_set:
        given["water_temperature_c"] = changes.water_temperature_c
    return dataset_record(service.datasets.describe(tenant, dataset_id, **given))


@router.patch("/jobs/{job_id}", tags=["jobs"], dependencies=JSON, responses=REFUSALS)
def change_job(
    job_id: str,
    changes: Annotated[JobChanges, Body(openapi_examples=OF_A_JOB)],
    service: Service,
    tenant: CallerTenant,
) -> JobRecord:
    """Change the name or the notes of a job in any state."""
    row = service.jobs.describe(tenant, job_id, **changes.model_dump(exclude_none=True))
    return job_record(row, service.jobs.place(row))

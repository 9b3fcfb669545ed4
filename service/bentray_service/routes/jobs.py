"""/v1/jobs: start, watch and cancel the work."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Query, Response, status
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from bentray_kernels.tomography.settings import Settings

from ..asked_settings import known_only
from ..errors import described
from ..wiring import Service
from .bodies import SmallBody, only
from .records import JobList, JobRecord, job_record

router = APIRouter(prefix="/v1/jobs", tags=["jobs"], route_class=SmallBody)


class JobRequest(BaseModel):
    """What to do with which dataset."""

    model_config = ConfigDict(extra="forbid")

    kind: Literal["reconstruction"]
    dataset: str = Field(description="Id of an uploaded dataset.")
    settings: Annotated[Settings, BeforeValidator(known_only)] = Field(
        default_factory=Settings, description="What is left out takes its default."
    )


@router.post(
    "",
    status_code=status.HTTP_202_ACCEPTED,
    dependencies=[Depends(only("application/json"))],
    responses=described(404, 413, 415, 422),
)
def start_job(asked: JobRequest, response: Response, service: Service) -> JobRecord:
    """Queue a job. It is stored before this answers, and survives a restart of the service."""
    dataset = service.datasets.get(asked.dataset)
    job = job_record(service.jobs.add(asked.kind, dataset["id"], asked.settings.to_dict()))
    service.runner.notify()
    response.headers["Location"] = job.links["self"]
    return job


@router.get("")
def list_jobs(service: Service, limit: Annotated[int, Query(ge=1, le=1000)] = 100) -> JobList:
    """Jobs, newest first."""
    return JobList(jobs=[job_record(row) for row in service.jobs.newest(limit)])


@router.get("/{job_id}", responses=described(404))
def show_job(job_id: str, service: Service) -> JobRecord:
    """One job: its state, its progress and the residual of every sweep so far."""
    return job_record(service.jobs.get(job_id))


@router.post(
    "/{job_id}/cancel",
    status_code=status.HTTP_202_ACCEPTED,
    responses=described(404, 409),
)
def cancel_job(job_id: str, service: Service) -> JobRecord:
    """Ask a job to stop. A queued one ends at once, a running one within a second or so."""
    return job_record(service.jobs.request_cancel(job_id))

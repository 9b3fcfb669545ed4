"""/v1/jobs: start, watch and cancel the work."""

from __future__ import annotations

from functools import partial
from typing import Annotated, Literal

from fastapi import APIRouter, Body, Depends, Query, Response, status
from fastapi.responses import FileResponse
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from bentray_kernels.tomography.settings import Settings
from bentray_workers.turntable import Turntable

from ..asked_settings import known_only
from ..errors import described
from ..refusals import NoAnimation
from ..wiring import Service
from .bodies import SmallBody, only
from .pictures import check_renderable
from .records import JobList, JobRecord, job_record

# Media type of each format of a turntable.
ANIMATIONS = {"zip": "application/zip", "apng": "image/apng"}

router = APIRouter(prefix="/v1/jobs", tags=["jobs"], route_class=SmallBody)


class ReconstructionRequest(BaseModel):
    """Reconstruct a dataset."""

    model_config = ConfigDict(extra="forbid")

    kind: Literal["reconstruction"]
    dataset: str = Field(description="Id of an uploaded dataset.")
    settings: Annotated[Settings, BeforeValidator(known_only)] = Field(
        default_factory=Settings, description="What is left out takes its default."
    )


class RefractionRequest(BaseModel):
    """Show a volume as glass from all sides."""

    model_config = ConfigDict(extra="forbid")

    kind: Literal["refraction"]
    volume: str = Field(description="Id of a volume in space with even spacing.")
    settings: Annotated[Turntable, BeforeValidator(partial(known_only, of=Turntable))] = Field(
        default_factory=Turntable, description="What is left out takes its default."
    )


JobRequest = Annotated[ReconstructionRequest | RefractionRequest, Body(discriminator="kind")]


@router.post(
    "",
    status_code=status.HTTP_202_ACCEPTED,
    dependencies=[Depends(only("application/json"))],
    responses=described(404, 413, 415, 422),
)
def start_job(asked: JobRequest, response: Response, service: Service) -> JobRecord:
    """Queue a job. It is stored before this answers, and survives a restart of the service."""
    if isinstance(asked, ReconstructionRequest):
        dataset = service.datasets.get(asked.dataset)
        row = service.jobs.add(asked.kind, asked.settings.to_dict(), dataset_id=dataset["id"])
    else:
        volume = service.volumes.get(asked.volume)
        check_renderable(volume)
        view = asked.settings.within(*volume["value_range"])
        row = service.jobs.add(asked.kind, view.plain(), volume_id=volume["id"])
    job = job_record(row)
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


@router.get(
    "/{job_id}/animation",
    response_class=FileResponse,
    responses={
        200: {"content": {media: {} for media in ANIMATIONS.values()}, "description": "The file."},
        **described(404),
    },
)
def animation(job_id: str, service: Service) -> FileResponse:
    """The pictures of a job of kind refraction, once it has succeeded."""
    job = service.jobs.get(job_id)
    if job["kind"] != "refraction" or job["state"] != "succeeded":
        raise NoAnimation(job["id"], job["kind"], job["state"])
    extension = job["settings"]["format"]
    path = service.files.animation(job["id"], extension)
    return FileResponse(path, media_type=ANIMATIONS[extension], filename=path.name)

"""/v1/jobs: start, watch and cancel the work."""

from __future__ import annotations

import logging
from functools import partial
from typing import Annotated, Literal
from urllib.parse import urlencode

from fastapi import APIRouter, Body, Depends, Header, Query, Request, Response, status
from fastapi.openapi.models import Example
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from bentray_kernels.tomography.settings import Settings
from bentray_workers.rendering.field_settings import FieldSettings, check_faces
from bentray_workers.rendering.turntable import Turntable
from bentray_workers.simulation.request import AskedSimulation

from ..asked_settings import known_only
from ..refusals import NoAnimation
from ..rows.ids import field_of
from ..web.errors import described
from ..wiring import CallerTenant, Service
from .bodies import SmallBody, only
from .downloads import download, download_of
from .models.records import JobKind, JobList, JobRecord, State, job_record
from .pictures import check_renderable

log = logging.getLogger("bentray.jobs")

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


class SimulationRequest(BaseModel):
    """Simulate the scan of a phantom; it becomes a dataset, with the truth in it."""

    model_config = ConfigDict(extra="forbid")

    kind: Literal["simulation"]
    settings: Annotated[AskedSimulation, BeforeValidator(partial(known_only, of=AskedSimulation))] = Field(
        default_factory=AskedSimulation, description="What is left out takes its default."
    )


class RefractionRequest(BaseModel):
    """Show a volume as glass from all sides."""

    model_config = ConfigDict(extra="forbid")

    kind: Literal["refraction"]
    volume: str = Field(description="Id of a volume in space with even spacing.")
    settings: Annotated[Turntable, BeforeValidator(partial(known_only, of=Turntable))] = Field(
        default_factory=Turntable, description="What is left out takes its default."
    )


class GeometryFieldRequest(BaseModel):
    """Make the geometry field of a mesh; the same mesh and settings have it at once the second time."""

    model_config = ConfigDict(extra="forbid")

    kind: Literal["geometry-field"]
    mesh: str = Field(description="Id of a mesh.")
    settings: Annotated[FieldSettings, BeforeValidator(partial(known_only, of=FieldSettings))] = Field(
        default_factory=FieldSettings, description="What is left out takes its default."
    )


EXAMPLES: dict[str, Example] = {
    "reconstruction": {
        "summary": "Sound speed from a scan",
        "value": {
            "kind": "reconstruction",
            "dataset": "ds-0123456789abcdef0123",
            "settings": {"nodes": 128, "sweeps": 8, "rays": "curved"},
        },
    },
    "simulation": {
        "summary": "A scan of a phantom, with noise on its travel times",
        "value": {"kind": "simulation", "settings": {"nodes": 64, "elements": 64, "noise_s": 2e-8}},
    },
    "refraction": {
        "summary": "A volume as glass from all sides",
        "value": {"kind": "refraction", "volume": "vol-0123456789abcdef0123", "settings": {"format": "zip"}},
    },
    "geometry-field": {
        "summary": "The geometry field of a mesh",
        "value": {"kind": "geometry-field", "mesh": "mesh-0123456789abcdef0123"},
    },
}

JobRequest = Annotated[
    ReconstructionRequest | SimulationRequest | RefractionRequest | GeometryFieldRequest,
    Body(discriminator="kind", openapi_examples=EXAMPLES),
]


@router.post(
    "",
    status_code=status.HTTP_202_ACCEPTED,
    dependencies=[Depends(only("application/json"))],
    responses=described(400, 404, 409, 413, 415, 422, 429, 503, 507),
)
def start_job(
    asked: JobRequest,
    response: Response,
    service: Service,
    tenant: CallerTenant,
    idempotency_key: Annotated[
        str | None,
        Header(
            min_length=1,
            max_length=200,
            description="A name for this request. Sent again with the same one, it makes no second job.",
        ),
    ] = None,
) -> JobRecord:
    """Queue a job. It is stored before this answers, and survives a restart of the service."""
    plan = None
    if isinstance(asked, ReconstructionRequest):
        dataset = service.datasets.get(tenant, asked.dataset)
        read = {"dataset_id": dataset["id"]}
        settings = asked.settings.to_dict()
        path = service.files.of(tenant).dataset(dataset["id"])
        plan = service.compute.plan(dataset["counts"], path, asked.settings)
        largest = plan["stored_bytes"]
    elif isinstance(asked, SimulationRequest):
        read, settings = {}, asked.settings.plain()
        plan = service.compute.plan_simulation(asked.settings)
        # Its parts, and the file that is made of them.
        largest = 2 * plan["result_bytes"]
    elif isinstance(asked, GeometryFieldRequest):
        mesh = service.meshes.get(tenant, asked.mesh)
        check_faces(mesh["faces"])
        settings = asked.settings.plain()
        largest = asked.settings.largest_bytes(mesh["faces"])
        read = {"mesh_id": mesh["id"], "field_id": field_of(asked.settings.content(mesh["content"]))}
    else:
        volume = service.volumes.get(tenant, asked.volume)
        check_renderable(volume)
        service.compute.check_turntable(volume["shape"], asked.settings)
        read = {"volume_id": volume["id"]}
        settings = asked.settings.within(*volume["value_range"]).plain()
        largest = asked.settings.largest_bytes
    job = job_record(
        service.jobs.add(
            tenant,
            asked.kind,
            settings,
            **read,
            plan=plan,
            reserve=(largest, service.quota.most_bytes),
            most_queued=service.settings.max_queued_jobs,
            key=idempotency_key,
        )
    )
    log.info("%s waits, of kind %s", job.id, job.kind, extra={"figures": {"job": job.id}})
    service.runner.notify()
    response.headers["Location"] = job.links["self"]
    return job


@router.get("", responses=described(404, 422))
def list_jobs(
    service: Service,
    tenant: CallerTenant,
    limit: Annotated[int, Query(ge=1, le=1000, description="At most so many.")] = 100,
    state: Annotated[State | None, Query(description="Only these.")] = None,
    kind: Annotated[JobKind | None, Query(description="Only these.")] = None,
    before: Annotated[str | None, Query(description="Only jobs older than the one of this id.")] = None,
) -> JobList:
    """Jobs, newest first; `next` leads to the older ones."""
    rows = service.jobs.newest(tenant, limit + 1, state, kind, before)
    shown = [job_record(row) for row in rows[:limit]]
    if len(rows) == len(shown):
        return JobList(jobs=shown, next=None)
    asked = {"limit": limit, "state": state, "kind": kind, "before": shown[-1].id}
    given = urlencode({name: value for name, value in asked.items() if value is not None})
    return JobList(jobs=shown, next=f"/v1/jobs?{given}")


@router.get("/{job_id}", responses=described(404))
def show_job(job_id: str, service: Service, tenant: CallerTenant) -> JobRecord:
    """One job: its state, its progress and the residual of every sweep so far."""
    return job_record(service.jobs.get(tenant, job_id))


@router.post(
    "/{job_id}/cancel",
    status_code=status.HTTP_202_ACCEPTED,
    responses=described(404, 409),
)
def cancel_job(job_id: str, service: Service, tenant: CallerTenant) -> JobRecord:
    """Ask a job to stop. A queued one ends at once, a running one within a second or so."""
    return job_record(service.jobs.request_cancel(tenant, job_id))


@router.head("/{job_id}/animation", include_in_schema=False)
@router.get(
    "/{job_id}/animation",
    response_class=Response,
    responses={**download_of(*ANIMATIONS.values()), **described(404, 409, 503)},
)
def animation(job_id: str, request: Request, service: Service, tenant: CallerTenant) -> Response:
    """The pictures of a job of kind refraction, once it has succeeded.

    A download that broke off goes on with Range, and If-Range with the ETag of the first answer.
    """
    job = service.jobs.get(tenant, job_id)
    if job["kind"] != "refraction" or job["state"] != "succeeded":
        raise NoAnimation(job["id"], job["kind"], job["state"])
    extension = job["settings"]["format"]
    path = service.files.store.bring(service.files.of(tenant).animation(job["id"], extension))
    return download(request, path, repr((job["id"], job["finished"])), ANIMATIONS[extension])

"""/v1/jobs: start, list, show, preview, cancel and delete jobs; /v1/plans: what a job would be."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Annotated, Literal, Union
from urllib.parse import urlencode

from fastapi import APIRouter, Body, Depends, Query, Request, Response, status

from bentray_workers.reconstruction.preview import checkpoint_image

from ..errors import NoAnimation, NoPreview
from ..files.deletion import StoredItem
from ..jobs.estimate import READ, estimate
from ..jobs.kinds import KINDS
from ..rows.ids import checked
from ..rows.jobs import Submission
from ..rows.tables import ENDED, JobRow
from ..web.errors import problems
from ..wiring import Access, Background, CallerTenant, CurrentCaller, Stores
from .bodies import IdempotencyKey, Limit, SmallBody, accept_media_types, answer_made
from .downloads import download, download_of
from .models.job_records import EstimateRecord, JobList, JobRecord, PlanRecord, PreviewRecord, State
from .models.name_changes import TEXT
from .pictures import check_render_rate
from .record_conversion import job_record

log = logging.getLogger("bentray.jobs")

# Media types of turntable animations.
ANIMATIONS = {"zip": "application/zip", "apng": "image/apng"}

router = APIRouter(prefix="/v1/jobs", tags=["jobs"], route_class=SmallBody)


if TYPE_CHECKING:
    from ..jobs.kind import JobRequest as JobRequest

    JobKind = str
else:
    JobKind = Literal[tuple(KINDS)]
    EXAMPLES = {name: kind.example for name, kind in KINDS.items()}
    JobRequest = Annotated[
        Union[tuple(kind.request for kind in KINDS.values())],  # noqa: UP007 - made of a tuple
        Body(discriminator="kind", openapi_examples=EXAMPLES),
    ]


@router.post(
    "",
    status_code=status.HTTP_202_ACCEPTED,
    dependencies=[Depends(accept_media_types("application/json"))],
    responses=problems(400, 404, 409, 413, 415, 422, 429, 503, 507),
)
def start_job(
    job_request: JobRequest,
    response: Response,
    stores: Stores,
    background: Background,
    access: Access,
    caller: CurrentCaller,
    idempotency_key: IdempotencyKey = None,
) -> JobRecord:
    """Queue a job. It is stored before the response and survives a restart of the service."""
    kind: str = job_request.kind
    tenant = caller.tenant
    background.webhooks.check(tenant, job_request.webhook)
    new = KINDS[kind].plan(job_request, tenant, stores, background.runner.compute)
    limits = stores.quota.most_bytes, access.settings.max_queued_jobs
    how = Submission(*limits, idempotency_key, caller.who, job_request.webhook)
    row = stores.jobs.add(tenant, new, how)
    job = _shown(stores, background, row)
    log.info("%s queued, kind %s", job.id, job.kind, extra={"figures": {"job": job.id}})
    background.runner.notify(job.id)
    answer_made(response, job.links["self"], replayed=row.replayed)
    return job


@router.get("", responses=problems(404, 422))
def list_jobs(
    stores: Stores,
    tenant: CallerTenant,
    limit: Limit = 100,
    state: Annotated[State | None, Query(description="Only these.")] = None,
    kind: Annotated[JobKind | None, Query(description="Only these.")] = None,
    batch: Annotated[str | None, Query(description="Only jobs of this batch.")] = None,
    before: Annotated[str | None, Query(description="Only jobs older than this job.")] = None,
    text: Annotated[
        str | None,
        Query(
            max_length=200,
            pattern=TEXT,
            description="Only jobs with this text in their id, name, notes or owner, or in the id or title "
            "of their scan, volume or mesh, in capitals or small letters.",
        ),
    ] = None,
) -> JobList:
    """List jobs, newest first; `next` is the address of the next page."""
    batch_id = None if batch is None else checked("batch", batch)
    equal = {"state": state, "kind": kind, "batch_id": batch_id}
    rows = stores.jobs.search(tenant, limit + 1, before, text, **equal)
    shown = [job_record(row) for row in rows[:limit]]
    if len(rows) == len(shown):
        return JobList(jobs=shown, next=None)
    filters = {
        "limit": limit,
        "state": state,
        "kind": kind,
        "text": text,
        "batch": batch,
        "before": shown[-1].id,
    }
    query = urlencode({name: value for name, value in filters.items() if value is not None})
    return JobList(jobs=shown, next=f"/v1/jobs?{query}")


@router.get("/{job_id}", responses=problems(404))
def show_job(job_id: str, stores: Stores, background: Background, tenant: CallerTenant) -> JobRecord:
    """Show one job: state, progress, and the residual after every iteration."""
    return _shown(stores, background, stores.jobs.get(tenant, job_id))


def _shown(stores: Stores, background: Background, row: JobRow) -> JobRecord:
    """The record of one job, with its place in the queue, its estimate and its webhook."""
    minutes = None
    if row.state == "queued":
        minutes = estimate(row.plan, stores.jobs.durations(row.tenant, row.kind, READ)).minutes
    delivery = None
    if row.webhook is not None and row.state in ENDED:
        delivery = background.webhooks.deliveries.of_job(row.tenant, row.id)
    return job_record(row, stores.jobs.place(row), minutes, delivery)


@router.post(
    "/{job_id}/cancel",
    status_code=status.HTTP_202_ACCEPTED,
    responses=problems(404, 409),
)
def cancel_job(job_id: str, stores: Stores, tenant: CallerTenant) -> JobRecord:
    """Cancel a job. A queued job ends at once, a running one within a second or so."""
    return job_record(stores.jobs.request_cancel(tenant, job_id))


@router.delete("/{job_id}", status_code=status.HTTP_204_NO_CONTENT, responses=problems(404, 409, 503))
def delete_job(job_id: str, stores: Stores, tenant: CallerTenant) -> None:
    """Delete a job that has ended, with the volume, animation or geometry field that it made.

    A simulated scan stays, and so does a geometry field that another job made too.
    """
    stores.deletion.delete(StoredItem(tenant, "job", job_id))


@router.head("/{job_id}/animation", include_in_schema=False)
@router.get(
    "/{job_id}/animation",
    response_class=Response,
    responses={**download_of(*ANIMATIONS.values()), **problems(404, 409, 503)},
)
def animation(job_id: str, request: Request, stores: Stores, tenant: CallerTenant) -> Response:
    """Download the animation of a successful refraction job.

    Interrupted downloads can be resumed with Range and If-Range.
    """
    job = stores.jobs.get(tenant, job_id)
    if job.kind != "refraction" or job.state != "succeeded":
        raise NoAnimation(job.id, job.kind, job.state)
    extension = job.settings["format"]
    path = stores.files.store.fetch(stores.files.of(tenant).animation(job.id, extension))
    return download(request, path, repr((job.id, job.finished)), ANIMATIONS[extension])


@router.get("/{job_id}/preview", responses=problems(404, 409, 429), dependencies=[Depends(check_render_rate)])
def show_preview(job_id: str, response: Response, stores: Stores, tenant: CallerTenant) -> PreviewRecord:
    """Show the image that a running reconstruction has reached, reduced to at most 256 nodes along a side.

    There is one after the first iteration, or after some seconds of a longer one.
    """
    job = stores.jobs.get(tenant, job_id)
    if job.kind != "reconstruction" or job.state not in ("running", "cancelling"):
        raise NoPreview(job.id, job.kind, job.state)
    image = checkpoint_image(stores.files.of(tenant).checkpoints(job.id))
    if image is None:
        raise NoPreview(job.id, "reconstruction", "before its first image")
    response.headers["Cache-Control"] = "no-store"
    return PreviewRecord.model_validate(image)


plans_router = APIRouter(prefix="/v1/plans", tags=["jobs"], route_class=SmallBody)


@plans_router.post(
    "",
    dependencies=[Depends(accept_media_types("application/json"))],
    responses=problems(400, 404, 413, 415, 422, 503),
)
def plan_job(
    job_request: JobRequest, stores: Stores, background: Background, tenant: CallerTenant
) -> EstimateRecord:
    """Plan a job without starting it: method, nodes, tasks, memory, estimated time and place in the queue.

    A job that would be rejected is rejected here with the same error.
    """
    kind: str = job_request.kind
    background.webhooks.check(tenant, job_request.webhook)
    plan = KINDS[kind].plan(job_request, tenant, stores, background.runner.compute).plan
    found = estimate(plan, stores.jobs.durations(tenant, kind, READ))
    return EstimateRecord(
        plan=None if plan is None else PlanRecord.model_validate(plan),
        minutes=found.minutes,
        rough=found.rough,
        compared=found.compared,
        basis=found.basis,
        ahead=stores.jobs.next_place(tenant),
    )

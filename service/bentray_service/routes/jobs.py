"""/v1/jobs: start, list, show, name, preview, cancel and delete jobs; /v1/plans: what a job would be."""

from __future__ import annotations

import logging
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Literal, Union
from urllib.parse import urlencode

from fastapi import APIRouter, Body, Depends, Query, Response, status
from fastapi.openapi.models import Example

from bentray_workers.reconstruction.preview import checkpoint_image

from ..errors import NoAnimation, NoPreview
from ..jobs.estimate import READ, estimate
from ..jobs.kinds import KINDS
from ..rows.ids import checked
from ..rows.jobs import NewJob
from ..rows.tables import ENDED, JobRow
from ..web.errors import problems
from ..wiring import Context, RequestContext
from .bodies import IdempotencyKey, Limit, SmallBody, accept_media_types, answer_made
from .downloads import download, download_of
from .models.job_records import EstimateRecord, JobList, JobRecord, PlanRecord, PreviewRecord, State
from .models.name_changes import TEXT, JobChanges
from .pictures import check_render_rate
from .record_conversion import job_record

log = logging.getLogger("bentray.jobs")

JSON = [Depends(accept_media_types("application/json"))]
NAMES: dict[str, Example] = {"named": {"value": {"name": "With the new water speed"}}}
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
    dependencies=JSON,
    responses=problems(400, 404, 409, 413, 415, 422, 429, 503, 507),
)
def start_job(
    job_request: JobRequest,
    response: Response,
    context: Context,
    idempotency_key: IdempotencyKey = None,
) -> JobRecord:
    """Queue a job. It is stored before the response and survives a restart of the service."""
    new = _planned(job_request, context)
    how = context.submission(idempotency_key, job_request.webhook)
    row = context.stores.jobs.add(context.tenant, new, how)
    job = _shown(context, row)
    log.info("%s queued, kind %s", job.id, job.kind, extra={"figures": {"job": job.id}})
    context.background.runner.notify(job.id)
    answer_made(response, job.links["self"], replayed=row.replayed)
    return job


@router.get("", responses=problems(404, 422))
def list_jobs(
    context: Context,
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
    rows = context.stores.jobs.search(context.tenant, limit + 1, before, text, **equal)
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
def show_job(job_id: str, context: Context) -> JobRecord:
    """Show one job: state, progress, and the residual after every iteration."""
    return _shown(context, context.stores.jobs.get(context.tenant, job_id))


def _shown(context: RequestContext, row: JobRow) -> JobRecord:
    """The record of one job, with its place in the queue, its estimate and its webhook."""
    jobs, minutes, delivery = context.stores.jobs, None, None
    if row.state == "queued":
        minutes = estimate(row.plan, jobs.durations(row.tenant, row.kind, READ)).minutes
    if row.webhook is not None and row.state in ENDED:
        delivery = context.background.webhooks.deliveries.of_job(row.tenant, row.id)
    return job_record(row, jobs.place(row), minutes, delivery)


def _planned(job_request: JobRequest, context: RequestContext) -> NewJob:
    """The job of a request, whose webhook is checked first."""
    context.background.webhooks.check(context.tenant, job_request.webhook)
    kind, compute = KINDS[str(job_request.kind)], context.background.runner.compute
    return kind.plan(job_request, context.tenant, context.stores, compute)


@router.post(
    "/{job_id}/cancel",
    status_code=status.HTTP_202_ACCEPTED,
    responses=problems(404, 409),
)
def cancel_job(job_id: str, context: Context) -> JobRecord:
    """Cancel a job. A queued job ends at once, a running one within a second or so."""
    return job_record(context.stores.jobs.request_cancel(context.tenant, job_id))


@router.delete("/{job_id}", status_code=status.HTTP_204_NO_CONTENT, responses=problems(404, 409, 503))
def delete_job(job_id: str, context: Context) -> None:
    """Delete a job that has ended, with the volume, animation or geometry field that it made.

    A simulated scan stays, and so does a geometry field that another job made too.
    """
    context.delete("job", job_id)


@router.patch("/{job_id}", dependencies=JSON, responses=problems(400, 404, 413, 415, 422))
def change_job(
    job_id: str, changes: Annotated[JobChanges, Body(openapi_examples=NAMES)], context: Context
) -> JobRecord:
    """Change the name or the notes of a job in any state."""
    jobs = context.stores.jobs
    row = jobs.describe(context.tenant, job_id, **changes.model_dump(exclude_none=True))
    return job_record(row, jobs.place(row))


@router.head("/{job_id}/animation", include_in_schema=False)
@router.get(
    "/{job_id}/animation",
    response_class=Response,
    responses={**download_of(*ANIMATIONS.values()), **problems(404, 409, 503)},
)
def animation(job_id: str, context: Context) -> Response:
    """Download the animation of a successful refraction job.

    Interrupted downloads can be resumed with Range and If-Range.
    """
    job, files = context.stores.jobs.get(context.tenant, job_id), context.stores.files
    if job.kind != "refraction" or job.state != "succeeded":
        found = f"{job.id}, {job.kind}, {job.state}"
        raise NoAnimation("job", found, "a successful job of kind refraction")
    extension = job.settings["format"]
    path = files.store.fetch(files.of(context.tenant).animation(job.id, extension))
    return download(context.request, path, repr((job.id, job.finished)), ANIMATIONS[extension])


@router.get("/{job_id}/preview", responses=problems(404, 409, 429), dependencies=[Depends(check_render_rate)])
def show_preview(job_id: str, response: Response, context: Context) -> PreviewRecord:
    """Show the image that a running reconstruction has reached, reduced to at most 256 nodes along a side.

    There is one after the first iteration, or after some seconds of a longer one.
    """
    files, job = context.stores.files.of(context.tenant), context.stores.jobs.get(context.tenant, job_id)
    image, state = None, job.state
    if job.kind == "reconstruction" and state in ("running", "cancelling"):
        image, state = checkpoint_image(files.checkpoints(job.id)), "before its first image"
    if image is None:
        accepted = "a running job of kind reconstruction, after its first iteration"
        raise NoPreview("job", f"{job.id}, {job.kind}, {state}", accepted)
    response.headers["Cache-Control"] = "no-store"
    return PreviewRecord.model_validate(image)


plans_router = APIRouter(prefix="/v1/plans", tags=["jobs"], route_class=SmallBody)


@plans_router.post("", dependencies=JSON, responses=problems(400, 404, 413, 415, 422, 503))
def plan_job(job_request: JobRequest, context: Context) -> EstimateRecord:
    """Plan a job without starting it: method, nodes, tasks, memory, estimated time and place in the queue.

    A job that would be rejected is rejected here with the same error.
    """
    new, jobs = _planned(job_request, context), context.stores.jobs
    found = estimate(new.plan, jobs.durations(context.tenant, new.kind, READ))
    return EstimateRecord(
        plan=None if new.plan is None else PlanRecord.model_validate(new.plan),
        rough=found.rough,
        **asdict(found),
        ahead=jobs.queue_position(context.tenant),
    )

"""/v1/plans: what a job would be, and how long it would take, without starting it."""

from __future__ import annotations

from fastapi import APIRouter, Depends

from ..jobs.estimate import READ, estimate
from ..jobs.kinds import KINDS
from ..web.errors import problems
from ..wiring import Background, CallerTenant, Stores
from .bodies import SmallBody, accept_media_types
from .jobs import JobRequest
from .models.job_records import EstimateRecord, PlanRecord

router = APIRouter(prefix="/v1/plans", tags=["jobs"], route_class=SmallBody)


@router.post(
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

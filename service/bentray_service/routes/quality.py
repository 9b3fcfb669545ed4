"""/v1/datasets/{id}/quality: what is wrong with a scan, as figures and as a page."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Query, Request, Response
from starlette.concurrency import run_in_threadpool

from ..web.errors import problems
from ..wiring import CallerTenant, Service, caller_of, parts_of
from .models.quality_records import QualityRecord
from .pictures import PICTURE, picture, while_connected

router = APIRouter()

Picker = Annotated[
    Literal["aic", "threshold", "energy-ratio", "sta-lta", "correlation", "matched"],
    Query(description="What reads times from traces; of no matter where the scan brought its times."),
]


async def check_render_rate(request: Request) -> None:
    """A scan is examined where a picture may be drawn: it takes a worker for seconds."""
    parts_of(request).sign_in.check_render(caller_of(request))


@router.get(
    "/{dataset_id}/quality",
    responses=problems(404, 422, 429, 503),
    dependencies=[Depends(check_render_rate)],
)
async def show_quality(
    dataset_id: str, request: Request, service: Service, tenant: CallerTenant, picker: Picker = "aic"
) -> QualityRecord:
    """Examine a scan on a worker: dead, swapped, inverted elements, wrong times, and what is done of it."""
    dataset = await run_in_threadpool(service.datasets.get, tenant, dataset_id)
    path = service.files.of(tenant).dataset(dataset["id"])
    work = service.pictures.quality(tenant, dataset, path, picker)
    return QualityRecord.model_validate(await while_connected(request, work))


@router.head("/{dataset_id}/quality.png", include_in_schema=False)
@router.get("/{dataset_id}/quality.png", response_class=Response, responses={**PICTURE, **problems(404, 422)})
async def quality_png(
    dataset_id: str, request: Request, service: Service, tenant: CallerTenant, picker: Picker = "aic"
) -> Response:
    """The same as a page: gathers with their picks, the matrix of times, what was left out, and why."""
    dataset = await run_in_threadpool(service.datasets.get, tenant, dataset_id)
    path = service.files.of(tenant).dataset(dataset["id"])
    how = {"picker": picker, "what": "quality"}
    return await picture(
        request, dataset, how, lambda: service.pictures.quality_png(tenant, dataset, path, picker)
    )

"""/v1/datasets/{id}/quality: what is wrong with a scan, as figures and as a page."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Query, Request, Response

from ..errors import described
from ..wiring import CallerTenant, Service, caller_of, parts_of
from .pictures import PICTURE, picture
from .quality_records import QualityRecord

router = APIRouter()

Picker = Annotated[
    Literal["aic", "threshold", "energy-ratio", "sta-lta", "correlation", "matched"],
    Query(description="What reads times from traces; of no matter where the scan brought its times."),
]


def admitted(request: Request) -> None:
    """A scan is examined where a picture may be drawn: it takes a worker for seconds."""
    parts_of(request).door.check_render(caller_of(request))


@router.get(
    "/{dataset_id}/quality",
    responses=described(404, 422, 429, 503),
    dependencies=[Depends(admitted)],
)
def show_quality(
    dataset_id: str, service: Service, tenant: CallerTenant, picker: Picker = "aic"
) -> QualityRecord:
    """Examine a scan on a worker: dead, swapped, inverted elements, wrong times, and what is done of it."""
    dataset = service.datasets.get(tenant, dataset_id)
    path = service.files.of(tenant).dataset(dataset["id"])
    return QualityRecord.model_validate(service.compute.quality(path, picker))


@router.head("/{dataset_id}/quality.png", include_in_schema=False)
@router.get(
    "/{dataset_id}/quality.png", response_class=Response, responses={**PICTURE, **described(404, 422)}
)
def quality_png(
    dataset_id: str, request: Request, service: Service, tenant: CallerTenant, picker: Picker = "aic"
) -> Response:
    """The same as a page: gathers with their picks, the matrix of times, what was left out, and why."""
    dataset = service.datasets.get(tenant, dataset_id)
    path = service.files.of(tenant).dataset(dataset["id"])
    how = {"picker": picker, "what": "quality"}
    return picture(request, dataset, how, lambda: service.compute.quality_png(path, picker))

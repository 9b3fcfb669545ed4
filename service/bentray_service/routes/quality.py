"""/v1/datasets/{id}/quality: quality report of a scan as JSON and as an image."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Depends, Query, Request, Response

from bentray_kernels.picker_names import DEFAULT_PICKER, PickerName

from ..web.errors import problems
from ..wiring import Background, FindDataset, access_of, caller_of
from .models.quality_records import QualityRecord
from .pictures import PICTURE, picture, while_connected

router = APIRouter()

Picker = Annotated[
    PickerName,
    Query(description="Picker of first arrivals in traces; ignored for scans with travel times."),
]


async def check_render_rate(request: Request) -> None:
    """Limit the rate of quality reports like that of rendered images."""
    access_of(request.scope).sign_in.check_render(caller_of(request))


@router.get(
    "/{dataset_id}/quality",
    responses=problems(404, 422, 429, 503),
    dependencies=[Depends(check_render_rate)],
)
async def show_quality(
    find: FindDataset,
    request: Request,
    background: Background,
    picker: Picker = DEFAULT_PICKER,
) -> QualityRecord:
    """Check the quality of a scan on a worker: faulty elements and times, and the action taken for each."""
    dataset = await find()
    work = background.pictures.quality(*dataset, picker)
    return QualityRecord.model_validate(await while_connected(request, work))


@router.head("/{dataset_id}/quality.png", include_in_schema=False)
@router.get("/{dataset_id}/quality.png", response_class=Response, responses={**PICTURE, **problems(404, 422)})
async def quality_png(
    find: FindDataset,
    request: Request,
    background: Background,
    picker: Picker = DEFAULT_PICKER,
) -> Response:
    """The quality report as an image: gathers with picks, matrix of times, findings."""
    dataset = await find()
    how = {"picker": picker, "what": "quality", "water_temperature_c": dataset.row.water_temperature_c}
    return await picture(request, dataset.row, how, lambda: background.pictures.quality_png(*dataset, picker))

"""/v1/datasets/{id}/geometry and /traces: what the page of a scan draws."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Query, Request

from ..web.errors import problems
from ..wiring import Background, FindDataset
from .models.quality_records import EmissionRecord, GeometryRecord
from .pictures import while_connected
from .quality import check_render_rate

router = APIRouter()


@router.get(
    "/{dataset_id}/geometry",
    responses=problems(404, 422, 429, 503),
    dependencies=[Depends(check_render_rate)],
)
async def show_geometry(find: FindDataset, request: Request, background: Background) -> GeometryRecord:
    """Show the elements, the acquisition and the water of a scan, read by a worker."""
    dataset = await find()
    work = background.pictures.scan_geometry(*dataset)
    return GeometryRecord.model_validate(await while_connected(request, work))


@router.get(
    "/{dataset_id}/traces", responses=problems(404, 422, 429, 503), dependencies=[Depends(check_render_rate)]
)
async def show_traces(
    find: FindDataset,
    request: Request,
    background: Background,
    emission: Annotated[int, Query(ge=0, description="Index of the emission, from 0.")] = 0,
    slice: Annotated[int, Query(ge=0, description="Index of the slice, from 0.")] = 0,  # noqa: A002
    quantity: Annotated[
        Literal["object", "water"], Query(description="Traces with the object, or of the water shot.")
    ] = "object",
) -> EmissionRecord:
    """Show the traces of one emission, at most 512 receivers and 1024 samples, and their picks."""
    dataset = await find()
    how = {"emission": emission, "index": slice, "what": quantity}
    work = background.pictures.emission_traces(*dataset, how)
    return EmissionRecord.model_validate(await while_connected(request, work))

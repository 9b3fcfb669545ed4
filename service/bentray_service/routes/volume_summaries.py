"""/v1/volumes/{id}/summary: quantities, choice of the model, and errors of a reconstruction."""

from __future__ import annotations

from fastapi import APIRouter, Depends, Request
from starlette.concurrency import run_in_threadpool

from bentray_kernels.errors import InvalidInput

from ..rows.tables import DatasetRow, VolumeRow
from ..web.errors import problems
from ..wiring import Background, FindVolume, Stores
from .models.summary_records import SummaryRecord
from .pictures import check_render_rate, while_connected

router = APIRouter()


def scan_of(stores: Stores, volume: VolumeRow) -> DatasetRow:
    """The scan of a reconstruction.

    Raises:
        InvalidInput: naming ``volume``, for an uploaded one.
    """
    if volume.job_id is None:
        raise InvalidInput("volume", f"{volume.id}, an upload", "the result of a reconstruction")
    return stores.datasets.get(volume.tenant, volume.dataset_id)


@router.get(
    "/{volume_id}/summary",
    responses=problems(404, 422, 429, 503),
    dependencies=[Depends(check_render_rate)],
)
async def show_summary(
    find: FindVolume, request: Request, stores: Stores, background: Background
) -> SummaryRecord:
    """Summarise a reconstruction on a worker: quantities, what auto compared, errors against the truth."""
    volume = await find()
    work = background.pictures.summary(volume, await run_in_threadpool(scan_of, stores, volume))
    return SummaryRecord.model_validate(await while_connected(request, work))

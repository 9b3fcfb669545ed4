"""/v1/volumes/{id}/summary: quantities, choice of the model, and errors of a reconstruction."""

from __future__ import annotations

from pathlib import Path

from fastapi import APIRouter, Depends, Request
from starlette.concurrency import run_in_threadpool

from bentray_kernels.errors import InvalidInput

from ..rows.tables import DatasetRow, VolumeRow
from ..rows.tenants import Tenant
from ..web.errors import problems
from ..wiring import Background, FindVolume, Stores
from .models.summary_records import SummaryRecord
from .pictures import while_connected
from .quality import check_render_rate

router = APIRouter()


def scan_of(stores: Stores, tenant: Tenant, volume: VolumeRow) -> tuple[DatasetRow, Path]:
    """The scan of a reconstruction: its row, and its file, fetched from the store.

    Raises:
        InvalidInput: naming ``volume``, for an uploaded one.
    """
    if volume.job_id is None:
        raise InvalidInput("volume", f"{volume.id}, an upload", "the result of a reconstruction")
    dataset = stores.datasets.get(tenant, volume.dataset_id)
    return dataset, stores.files.store.fetch(stores.files.of(tenant).dataset(dataset.id))


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
    dataset, scan = await run_in_threadpool(scan_of, stores, volume.tenant, volume.row)
    work = background.pictures.summary(*volume, dataset, scan)
    return SummaryRecord.model_validate(await while_connected(request, work))

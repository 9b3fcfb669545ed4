"""/v1/volumes/{id}/histogram: how often each value occurs in a volume."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Query, Request

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.quantities import QUANTITIES, QuantityName
from bentray_workers.rendering.histogram import BINS, DEFAULT_BINS

from ..web.errors import problems
from ..wiring import Background, FindVolume
from .models.job_records import HistogramRecord
from .pictures import while_connected
from .quality import check_render_rate

router = APIRouter()


@router.get(
    "/{volume_id}/histogram",
    responses=problems(404, 422, 429, 503),
    dependencies=[Depends(check_render_rate)],
)
async def show_histogram(
    find: FindVolume,
    request: Request,
    background: Background,
    quantity: Annotated[
        Literal[QuantityName, "value"] | None,
        Query(
            description="Reconstructions: speed (default), coverage, attenuation if the scan has amplitudes, "
            "recovery if resolution_check was set, uncertainty (m/s) and reflection (dB) if requested. "
            "Uploads: value."
        ),
    ] = None,
    bins: Annotated[
        int,
        Query(
            ge=BINS.least, le=BINS.most, description="Bins of equal width between least and greatest value."
        ),
    ] = DEFAULT_BINS,
) -> HistogramRecord:
    """Count the nodes of a volume by value, on a worker; and the surface that a picture shows by default."""
    volume = await find()
    uploaded = volume.row.job_id is None
    chosen = quantity or ("value" if uploaded else "speed")
    if (chosen == "value") != uploaded:
        accepted = "value: this is an uploaded volume" if uploaded else "one of " + ", ".join(QUANTITIES)
        raise InvalidInput("quantity", repr(quantity), accepted)
    work = background.pictures.histogram(*volume, chosen, bins)
    return HistogramRecord.model_validate(await while_connected(request, work))

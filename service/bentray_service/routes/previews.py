"""/v1/jobs/{id}/preview: the image of an unfinished reconstruction."""

from __future__ import annotations

from fastapi import APIRouter, Depends, Response

from bentray_workers.reconstruction.preview import checkpoint_image

from ..errors import NoPreview
from ..web.errors import problems
from ..wiring import CallerTenant, Stores
from .models.preview_record import PreviewRecord
from .quality import check_render_rate

router = APIRouter(prefix="/v1/jobs", tags=["jobs"])


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

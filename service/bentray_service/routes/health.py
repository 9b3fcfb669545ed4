"""/health: whether the process lives, and whether it can do its work."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest
from pydantic import BaseModel, Field

from ..refusals import NotReady
from ..web.errors import problems
from ..wiring import parts_of

router = APIRouter(prefix="/health", tags=["health"])
metrics_router = APIRouter(tags=["health"])


class Alive(BaseModel):
    """The process answers."""

    status: str = "alive"


class Ready(BaseModel):
    """The service can do its work."""

    status: str = "ready"
    workers: int = Field(description="Workers connected now.")
    free_bytes: int = Field(description="Free space in the data folder.")


# Both are coroutines without dependencies: neither waits for a thread of the pool that requests share.
@router.get("/live")
async def live() -> Alive:
    """Whether the process answers; a failure here means: start it anew."""
    # No thread is asked for, so that it answers while all of them wait for something.
    return Alive()


@router.get("/ready", responses=problems(503))
async def ready(request: Request) -> Ready:
    """Whether uploads and jobs can be served now; each fault is named."""
    seen = await parts_of(request).readiness.report()
    if seen.faults:
        raise NotReady(seen.faults)
    return Ready(workers=seen.workers, free_bytes=seen.free_bytes)


@metrics_router.get(
    "/metrics",
    response_class=Response,
    responses={200: {"content": {"text/plain": {}}, "description": "In the text format of Prometheus."}},
)
def metrics(request: Request) -> Response:
    """Requests, jobs, workers and disk, for Prometheus."""
    return Response(generate_latest(request.app.state.metrics.registry), media_type=CONTENT_TYPE_LATEST)

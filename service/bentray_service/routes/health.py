"""/health: liveness and readiness of the service."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest
from pydantic import BaseModel, Field

from ..errors import NotReady
from ..web.errors import problems
from ..wiring import background_of

router = APIRouter(prefix="/health", tags=["health"])
metrics_router = APIRouter(tags=["health"])


class Alive(BaseModel):
    """The process is alive."""

    status: str = "alive"


class Ready(BaseModel):
    """The service is ready."""

    status: str = "ready"
    workers: int = Field(description="Workers connected now.")
    free_bytes: int = Field(description="Free space in the data folder.")


# Both are coroutines without dependencies, so they do not wait for the thread pool of the requests.
@router.get("/live")
async def live() -> Alive:
    """Liveness: whether the process answers; restart it if it does not."""
    # Uses no thread, so that it answers while all of them are busy.
    return Alive()


@router.get("/ready", responses=problems(503))
async def ready(request: Request) -> Ready:
    """Readiness: whether uploads and jobs can be processed now; otherwise each fault is named."""
    seen = await background_of(request).readiness.report()
    if seen.faults:
        raise NotReady(seen.faults)
    return Ready(workers=seen.workers, free_bytes=seen.free_bytes)


@metrics_router.get(
    "/metrics",
    response_class=Response,
    responses={200: {"content": {"text/plain": {}}, "description": "Prometheus text format."}},
)
def metrics(request: Request) -> Response:
    """Metrics of requests, jobs, workers and disk in the Prometheus text format."""
    return Response(generate_latest(request.app.state.metrics.registry), media_type=CONTENT_TYPE_LATEST)

"""/health: whether the process lives, and whether it can do its work."""

from __future__ import annotations

import shutil

from fastapi import APIRouter, Request, Response
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest
from pydantic import BaseModel, Field
from sqlalchemy.exc import SQLAlchemyError

from bentray_kernels.errors import InvalidInput

from ..errors import described
from ..refusals import NotReady
from ..wiring import Service

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


@router.get("/live")
async def live() -> Alive:
    """Whether the process answers; a failure here means: start it anew."""
    # No thread is asked for, so that it answers while all of them wait for something.
    return Alive()


@router.get("/ready", responses=described(503))
def ready(service: Service) -> Ready:
    """Whether uploads and jobs can be served now; each fault is named."""
    faults: list[tuple[str, str, str]] = []
    try:
        service.database.probe()
    except SQLAlchemyError as error:
        found = error.value if isinstance(error, InvalidInput) else type(error).__name__
        faults.append(("database", found, "a database that can be written"))
    free = shutil.disk_usage(service.files.root).free
    needed = service.settings.min_free_bytes
    if free < needed:
        faults.append(("disk", f"{free} bytes free", f"at least {needed} bytes (BENTRAY_MIN_FREE_BYTES)"))
    if fault := service.files.store.fault():
        faults.append(("storage", fault, "a bucket that can be read (BENTRAY_STORAGE_URL)"))
    workers = service.compute.workers()
    if workers == 0:
        faults.append(("workers", "0 connected", "at least one Dask worker"))
    if not service.runner.alive():
        faults.append(("runner", "a thread has ended", "every thread that runs jobs; start the service anew"))
    if not service.reader.alive():
        faults.append(("reader", "the thread has ended", "one that reads uploads; start the service anew"))
    if faults:
        raise NotReady(faults)
    return Ready(workers=workers, free_bytes=free)


@metrics_router.get(
    "/metrics",
    response_class=Response,
    responses={200: {"content": {"text/plain": {}}, "description": "In the text format of Prometheus."}},
)
def metrics(request: Request) -> Response:
    """Requests, jobs, workers and disk, for Prometheus."""
    return Response(generate_latest(request.app.state.metrics.registry), media_type=CONTENT_TYPE_LATEST)

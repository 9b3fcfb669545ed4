"""/health: liveness and readiness of the service; /v1/cluster: health of the workers, lengths of queues."""

from fastapi import APIRouter, Request, Response
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest
from pydantic import BaseModel, ConfigDict, Field
from starlette.concurrency import run_in_threadpool

from ..readiness import Readiness
from ..web.errors import problems
from ..wiring import Context

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
    readiness: Readiness = request.app.state.background.readiness
    workers, free = await readiness.check()
    return Ready(workers=workers, free_bytes=free)


@metrics_router.get(
    "/metrics",
    response_class=Response,
    responses={200: {"content": {"text/plain": {}}, "description": "Prometheus text format."}},
)
def metrics(request: Request) -> Response:
    """Metrics of requests, jobs, workers and disk in the Prometheus text format."""
    return Response(generate_latest(request.app.state.metrics.registry), media_type=CONTENT_TYPE_LATEST)


cluster_router = APIRouter(prefix="/v1/cluster", tags=["cluster"])


class WorkerRecord(BaseModel):
    """One worker at its last heartbeat."""

    model_config = ConfigDict(from_attributes=True)

    threads: int | None = Field(description="Threads that run tasks.")
    memory_bytes: int | None = Field(description="Resident memory; null before the first heartbeat.")
    memory_limit_bytes: int = Field(description="Its limit; 0: none.")
    cpu_percent: float | None = Field(description="Of one processor core; null before the first heartbeat.")
    running_tasks: int = Field(description="Tasks of all tenants that run now.")
    paused: bool = Field(description="Whether it accepts no tasks, because its memory is nearly used up.")
    opencl: bool = Field(
        description="Whether an OpenCL device passed its self-test. Workers of the service itself test at "
        "the first job that needs a device."
    )
    compiling: bool = Field(description="Whether it compiles kernels, once for each kind of processor.")


class QueueRecord(BaseModel):
    """Jobs that have not ended: of the tenant, and of all tenants together."""

    queued: int = Field(description="Queued jobs of the tenant.")
    running: int = Field(description="Running jobs of the tenant.")
    all_queued: int = Field(description="Queued jobs of all tenants.")
    all_running: int = Field(description="Running jobs of all tenants.")
    waiting_images: int = Field(description="Images of the tenant that wait for a worker.")
    drawing_workers: int = Field(
        description="Workers that draw images, or compute what a page shows, of all tenants."
    )
    images_s: float | None = Field(
        description="Estimated time until all such images of the tenant are ready, s, from measured times of "
        "earlier ones; null without these, and where none is in progress."
    )


class ClusterRecord(BaseModel):
    """Workers and queues; it names no host and no job of another tenant."""

    workers: list[WorkerRecord]
    queue: QueueRecord


@cluster_router.get("", responses=problems(503))
async def show_cluster(context: Context) -> ClusterRecord:
    """Show the health of the workers and the lengths of the queues."""
    runner = context.background.runner
    workers = await run_in_threadpool(runner.compute.health)
    lengths = await run_in_threadpool(runner.queue.lengths, context.tenant)
    (queued, all_queued), (running, all_running) = lengths["queued"], lengths["running"]
    return ClusterRecord(
        workers=[WorkerRecord.model_validate(one) for one in workers],
        queue=QueueRecord(
            queued=queued,
            running=running,
            all_queued=all_queued,
            all_running=all_running,
            **context.background.pictures.load(context.tenant),
        ),
    )

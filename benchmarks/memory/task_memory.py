"""Memory of tasks of all kinds and several sizes, each in a new worker process, beside their plans."""

from collections.abc import Iterable, Mapping

from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_workers.cluster.capacities import MIB

from ._measured_tasks import JUDGED, QUICK, Job
from ._task_peaks import Measured, measured

# A plan is at most this much above the peak, and as many bytes, which a task may find free in its process.
EXCESS, SPARE_BYTES = 0.4, 16 * MIB


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Peak of the largest task of each size with its plan as goal, and the plan with what it may be at most.

    None of these sizes is one that the table of plans was fitted to. Pictures, which take seconds, come
    first, and Ctrl-C ends a run with the sizes measured so far.
    """
    jobs = [job for job in reversed(JUDGED) if not context.quick or job.name in QUICK]
    for number, job in enumerate(jobs):
        context.progress(number, len(jobs), str(job))
        try:
            with context.temporary_folder() as folder:
                (tasks,) = measured(folder, job)
        except KeyboardInterrupt:
            return
        yield from judged(job, tasks)


def judged(job: Job, tasks: Mapping[str, Measured]) -> tuple[Row, Row]:
    """The rows of the task with the largest peak."""
    name, task = max(tasks.items(), key=lambda item: item[1].peak_bytes)
    peak, planned = task.peak_bytes, max(task.plan.bytes for task in tasks.values())
    detail = f"{name}, above a warm worker"
    most = (1.0 + EXCESS) * peak + SPARE_BYTES
    goal = f"goal: the peak and {EXCESS:.0%}, and {SPARE_BYTES // MIB} MiB"
    return (
        Row(f"{job}: peak", peak / MIB, planned / MIB, "<=", "MiB", detail),
        Row(f"{job}: plan", planned / MIB, most / MIB, "<=", "MiB", goal),
    )

"""Memory of tasks of all kinds and several sizes, each in a new worker process, beside their plans."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_workers.cluster.capacities import MIB
from bentray_workers.cluster.connection import open_cluster

from ..reconstruction._worker_use import forget_peak, of_worker, peak_bytes
from ._measured_tasks import JOBS, QUICK, Job

# A plan is at most this much above the peak. A warm worker has about 60 MiB of freed memory left from loading
# its compiled code, which tasks take first; so what they take below that is not seen.
EXCESS, WARM_FREE_BYTES = 0.4, 64 * MIB


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Peak of each size with its plan as goal, and the plan with what it may be at most.

    Pictures, which take seconds, come first, and Ctrl-C ends a run with the sizes measured so far.
    """
    jobs = [job for job in reversed(JOBS) if not context.quick or job.name in QUICK]
    for number, job in enumerate(jobs):
        context.progress(number, len(jobs), str(job))
        try:
            with context.temporary_folder() as folder:
                found = measured(folder, job)
        except KeyboardInterrupt:
            return
        yield from found


def measured(folder: Path, job: Job) -> tuple[Row, Row]:
    """Run a job in a worker process of its own that has run a small one of its kind."""
    with open_cluster(workers=1, local_directory=folder) as cluster:
        job.run(cluster.client, folder, *job.warm)
        of_worker(cluster.client, forget_peak)
        idle = of_worker(cluster.client, peak_bytes)
        plan = job.run(cluster.client, folder, *job.size)
        peak = of_worker(cluster.client, peak_bytes) - idle
    name, planned = max(plan.items(), key=lambda item: item[1])
    return (
        Row(
            f"{job}: peak", peak / MIB, planned / MIB, "<=", "MiB", f"above a warm worker; planned for {name}"
        ),
        Row(
            f"{job}: plan",
            planned / MIB,
            ((1.0 + EXCESS) * peak + WARM_FREE_BYTES) / MIB,
            "<=",
            "MiB",
            f"goal: the peak and {EXCESS:.0%}, and what a warm worker has free",
        ),
    )

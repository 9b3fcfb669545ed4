"""Scaling of one scheduler: sleeping tasks on 1 to 8 workers, extrapolated to 1,000."""

import tempfile
from collections.abc import Iterable
from pathlib import Path

from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

from ._scaling_cluster import Run, machine
from ._scaling_model import DAY_S, Model
from ._scaling_picture import picture
from ._scaling_work import Work, of_a_slice

# Scans: nodes along a side, transducers, sweeps, slices. The first gives the length of the sleeping tasks.
SCANS, QUICK_SCANS = ((128, 256, 3, 40), (256, 512, 3, 44)), ((32, 32, 2, 4),)
WORKERS, QUICK_WORKERS = (1, 2, 4, 8), (1, 2)

# Tasks of the measured length, and of this one, which strains the scheduler more.
SHORT_S = 0.02
RUN_S, QUICK_RUN_S = 4.0, 1.0

MANY_WORKERS, MANY_SCANS = 1000, 10_000


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Cost of a task, and limits of one scheduler, with a picture."""
    scans = QUICK_SCANS if context.quick else SCANS
    context.progress(0, 3, "slices")
    works = [of_a_slice(nodes, elements, sweeps) for nodes, elements, sweeps, _ in scans]
    context.progress(1, 3, "sleeping tasks")
    runs = measured(
        works[0], QUICK_WORKERS if context.quick else WORKERS, QUICK_RUN_S if context.quick else RUN_S
    )
    models = [Model.fitted(work, runs) for work in works]
    context.progress(2, 3, "extrapolating")
    yield from costs(models[0], runs)
    for (nodes, _, _, slices), model in zip(scans, models, strict=True):
        yield from limits(model, nodes, slices)
    shortest = models[0].length_for(MANY_WORKERS)
    yield Row(
        f"shortest task, {MANY_WORKERS} workers", shortest, 5.0, "<=", "s", "that one scheduler can feed"
    )
    driven = [run for run in runs if run.tasks]
    slices_of = [slices for *_, slices in scans]
    context.save_picture("scaling.png", lambda: picture(models, driven, slices_of, MANY_SCANS, MANY_WORKERS))
    context.progress(3, 3, "done")


def measured(work: Work, workers: tuple[int, ...], seconds: float) -> list[Run]:
    """Runs of about so many seconds with each number of workers and each length, and an idle one."""
    runs = []
    with tempfile.TemporaryDirectory() as folder, machine(Path(folder)) as cluster:
        for count in workers:
            cluster.grow_to(count)
            cluster.run(work, 0.0, 4 * count)
            lengths = (work.seconds, SHORT_S)
            runs += [cluster.run(work, length, max(8, round(seconds * count / length))) for length in lengths]
            runs.append(cluster.idle(seconds))
    return runs


def costs(model: Model, runs: list[Run]) -> Iterable[Row]:
    """Overhead of a task."""
    work = model.work
    goal = 0.05 * 1e3 * work.seconds
    kernel = f"a task takes {1e3 * work.seconds:.0f} ms of a core"
    beat = f"and {1e3 * model.scheduler_beat:.2f} ms a heartbeat; {kernel}"
    yield Row("scheduler time, a task", 1e3 * model.scheduler_task, goal, "<=", "ms", beat)
    yield Row("driver time, a task", 1e3 * model.driver_task, goal, "<=", "ms", kernel)
    for length in sorted({run.length for run in runs if run.tasks}, reverse=True):
        own = [run for run in runs if run.tasks and run.length == length]
        shares = {run.workers: run.tasks / run.seconds * length / run.workers for run in own}
        detail = ", ".join(f"{count}: {share:.2f}" for count, share in shares.items())
        label = f"share of the ideal rate, {max(shares)} processes, tasks of {1e3 * length:.0f} ms"
        yield Row(label, shares[max(shares)], 0.9, ">=", "", f"by processes {detail}; two cores for all")


def limits(model: Model, nodes: int, slices: int) -> Iterable[Row]:
    """Limits of one scheduler and one service for scans of one size."""
    work, scan = model.work, f"{nodes}² by {slices}"
    tasks = (
        f"{work.tasks} tasks of {work.seconds:.2g} s a slice, {work.sent / 1e6:.2g} MB there and as much back"
    )
    moved = (work.sent + work.returned) / 1e6
    yield Row(f"bytes moved, a task, {scan}", moved, 1.0, "<=", "MB", tasks)
    busy = f"the busier of scheduler and service at 70 % of a processor, tasks of {work.seconds:.2g} s"
    most = model.most_workers(work.seconds)
    yield Row(f"workers, one scheduler, {scan}", most, MANY_WORKERS, ">=", "", busy)
    rate = MANY_SCANS * slices * work.tasks / DAY_S
    need = f"{MANY_SCANS} need {model.workers_for(MANY_SCANS, slices):.0f} workers, {rate:.0f} tasks a second"
    need += f" and {rate * moved:.0f} MB a second through the service"
    day = model.most_scans_a_day(slices, work.seconds)
    yield Row(f"scans a day, one scheduler, {scan}", day, MANY_SCANS, ">=", "", need)

"""Cluster benchmark: scaling to two workers, task overhead, rendering under load, resuming."""

import asyncio
import os
import tempfile
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from distributed import Future

from bentray_kernels.task_graph import Cancelled, Task
from bentray_kernels.tomography import Settings
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step
from bentray_service.pictures import Pictures
from bentray_service.rows.ids import LOCAL
from bentray_workers.cluster.connection import Cluster, open_cluster
from bentray_workers.cluster.fair_shares import IN_FLIGHT
from bentray_workers.cluster.task_pool import EndedFutures
from bentray_workers.cluster.task_retries import Attempts
from bentray_workers.files.reconstruction import write_reconstruction
from bentray_workers.reconstruction.reconstruction_run import reconstruct

from ..shared._synthetic_scan import made_up_scan

RUNS = 2


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """All rows, with the load average at their start."""
    load = os.getloadavg()[0]
    for row in measured(context.quick, context.progress):
        yield replace(row, detail=f"{row.detail}; load average {load:.1f} at the start")


def measured(quick: bool, progress: Step) -> Iterable[Row]:
    """All rows; ``quick`` takes smaller scans and two processes."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        yield from scaling(folder, quick, progress)
        with open_cluster(workers=2, local_directory=folder) as cluster:
            yield overhead(cluster, folder, 200 if quick else 1000, progress)
            yield rendering(cluster, folder, quick, progress)
            yield resuming(cluster, folder, quick, progress)


def scaling(folder: Path, quick: bool, progress: Step) -> Iterable[Row]:
    """Time on one worker over that on two, of slices and of one slice's emitters; R5's volume by SART."""
    nodes, elements = (64, 64) if quick else (128, 256)
    sart = Settings(method="sart", nodes=nodes, iterations=2 if quick else 3)
    newton = Settings(nodes=nodes, iterations=4, method="gauss-newton")
    ways = {
        "SART slices": (8 if quick else 40, sart),
        "Gauss-Newton slices": (2 if quick else 8, newton),
        "Gauss-Newton emitters": (1, newton),
    }
    scans = {slices: made_up_scan(folder / f"{slices}.h5", elements, slices) for slices, _ in ways.values()}
    taken: dict[str, dict[int, float]] = {name: {} for name in ways}
    for workers in (1, 2):
        with open_cluster(workers=workers, local_directory=folder) as cluster:
            for name, (slices, settings) in ways.items():
                progress(workers - 1, 2, f"{name} on {workers} workers")
                reconstruct(cluster.client, scans[1], settings)
                run = partial(reconstruct, cluster.client, scans[slices], settings)
                taken[name][workers] = min(seconds(run) for _ in range(1 if quick else RUNS))
    for name, by_workers in taken.items():
        detail = ", ".join(f"{n} workers {s:.2f} s" for n, s in by_workers.items())
        slices = f"{ways[name][0]} slices" if ways[name][0] > 1 else "one slice"
        what = f"{nodes}², {elements} transducers, {slices}"
        yield Row(
            f"scaling 1 to 2, {name}", by_workers[1] / by_workers[2], 1.8, ">=", "", f"{what}: {detail}"
        )


def overhead(cluster: Cluster, folder: Path, count: int, progress: Step) -> Row:
    """Overhead of a task, s, submitted as in reconstructions."""
    progress(0, 1, "empty calls")
    empty_calls(cluster, folder, 50)
    per_call = empty_calls(cluster, folder, count) / count
    return Row("overhead per task", 1e3 * per_call, 10.0, "<=", "ms", f"{count} empty calls on 2 workers")


def empty_calls(cluster: Cluster, folder: Path, count: int) -> float:
    """Seconds of so many calls that do nothing."""
    attempts = Attempts(cluster.client, folder / "empty")
    running: list[Future] = []
    ended = EndedFutures()
    begun, left = time.perf_counter(), count
    while left or running:
        while left and len(running) < 2 * IN_FLIGHT:
            running.append(ended.watch(attempts.submit(Task(bool))))
            left -= 1
        for future in ended.take():
            running.remove(future)
            attempts.result(future)
    return time.perf_counter() - begun


def rendering(cluster: Cluster, folder: Path, quick: bool, progress: Step) -> Row:
    """95th percentile of the rendering time of a slice during a reconstruction on the same workers."""
    nodes, elements, slices = (64, 64, 8) if quick else (128, 256, 16)
    path = made_up_scan(folder / "beside.h5", elements, slices)
    picture = folder / "picture.h5"
    write_reconstruction(
        picture, reconstruct(cluster.client, path, Settings(method="sart", nodes=nodes, iterations=1))
    )
    stop, taken = threading.Event(), []
    settings = Settings(method="sart", nodes=nodes, iterations=1000)

    def work() -> None:
        try:
            reconstruct(cluster.client, path, settings, stop=stop.is_set)
        except Cancelled:
            return

    thread = threading.Thread(target=work)
    thread.start()
    count = 10 if quick else 100

    async def draw() -> None:
        pictures = Pictures(cluster, lambda path: path)
        volume = {"job_id": "job_1", "shape": (nodes, nodes, slices)}
        try:
            for k in range(count):
                progress(k, count, "pictures beside a reconstruction")
                begun = time.perf_counter()
                await pictures.slice_png(LOCAL, volume, picture, {"index": k % slices})
                taken.append(time.perf_counter() - begun)
                await asyncio.sleep(0.05)
        finally:
            await pictures.close()

    try:
        asyncio.run(draw())
        busy = thread.is_alive()
    finally:
        stop.set()
        thread.join()
    detail = f"{count} pictures, median {np.median(taken):.3f} s, longest {max(taken):.3f} s"
    detail += f"; a reconstruction of {slices} slices of {nodes}², {elements} transducers, ran beside them"
    p95 = float(np.percentile(taken, 95)) if busy else None
    return Row("S2 render during a reconstruction, p95", p95, 1.0, "<", "s", detail)


def resuming(cluster: Cluster, folder: Path, quick: bool, progress: Step) -> Row:
    """Time of a run that is interrupted half-way and resumed, over that of an uninterrupted one."""
    nodes = 64 if quick else 128
    path = made_up_scan(folder / "torn.h5", 64 if quick else 256, 8 if quick else 16)
    settings = Settings(method="sart", nodes=nodes, iterations=3 if quick else 6)
    progress(0, 1, "resuming")
    whole = seconds(lambda: reconstruct(cluster.client, path, settings, work_dir=folder / "whole"))

    def torn(graph: Any) -> None:
        if 2 * graph.done >= graph.total:
            raise InterruptedError

    def half() -> None:
        try:
            reconstruct(cluster.client, path, settings, torn, work_dir=folder / "torn")
        except InterruptedError:
            return

    first = seconds(half)
    rest = seconds(lambda: reconstruct(cluster.client, path, settings, work_dir=folder / "torn"))
    detail = f"undisturbed {whole:.2f} s; torn after {first:.2f} s, resumed for {rest:.2f} s"
    return Row("resumed over undisturbed time", (first + rest) / whole, 1.2, "<=", "", detail)


def least(run: Callable[[], object], runs: int) -> float:
    """Least seconds of some runs, after one that is not counted."""
    run()
    return min(seconds(run) for _ in range(runs))


def seconds(run: Callable[[], object]) -> float:
    """That one run takes."""
    begun = time.perf_counter()
    run()
    return time.perf_counter() - begun

"""Cluster benchmark: scaling to two workers, task overhead, rendering under load, resuming, Table 8."""

from __future__ import annotations

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

from bentray_kernels import eikonal
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6
from bentray_kernels.task_graph import Cancelled, Task
from bentray_kernels.tomography import Settings
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step
from bentray_service.compute import Compute
from bentray_workers.cluster.attempts import Attempts
from bentray_workers.cluster.connection import Cluster, open_cluster
from bentray_workers.cluster.fair_shares import IN_FLIGHT
from bentray_workers.cluster.task_pool import finished
from bentray_workers.files.reconstruction import write_reconstruction
from bentray_workers.reconstruction.reconstruction_run import reconstruct
from bentray_workers.reconstruction.subdomains import solve_in_blocks

from ..shared._synthetic_scan import made_up_scan

# Processes and blocks along each axis in the column of Table 8; the machine may have fewer cores.
PROCESSES: dict[int, tuple[int, int]] = {1: (1, 1), 2: (2, 1), 4: (2, 2), 8: (4, 2)}
THEIRS_S = {128: 0.007, 256: 0.039}
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
        yield from blocks(folder, quick, progress)


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
    begun, left = time.perf_counter(), count
    while left or running:
        while left and len(running) < 2 * IN_FLIGHT:
            running.append(attempts.submit(Task(bool)))
            left -= 1
        for future in finished(cluster.client, running):
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
    compute = Compute(cluster, lambda path: path)
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
    try:
        for k in range(count):
            progress(k, count, "pictures beside a reconstruction")
            taken.append(seconds(partial(compute.slice_png, picture, index=k % slices)))
            time.sleep(0.05)
        busy = thread.is_alive()
    finally:
        stop.set()
        thread.join()
    detail = f"{count} pictures, median {np.median(taken):.3f} s, longest {max(taken):.3f} s"
    detail += f"; a reconstruction of {slices} slices of {nodes}², {elements} transducers, ran beside them"
    found = float(np.percentile(taken, 95)) if busy else None
    return Row("S2 render during a reconstruction, p95", found, 1.0, "<", "s", detail)


def resuming(cluster: Cluster, folder: Path, quick: bool, progress: Step) -> Row:
    """Time of a run that is interrupted half-way and resumed, over that of an uninterrupted one."""
    nodes = 64 if quick else 128
    path = made_up_scan(folder / "torn.h5", 64 if quick else 256, 8 if quick else 16)
    settings = Settings(method="sart", nodes=nodes, iterations=3 if quick else 6)
    progress(0, 1, "resuming")
    whole = seconds(lambda: reconstruct(cluster.client, path, settings, work_dir=folder / "whole"))

    def torn(found: Any) -> None:
        if 2 * found.done >= found.total:
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


def blocks(folder: Path, quick: bool, progress: Step) -> Iterable[Row]:
    """Table 8's cluster column: one projection in blocks on so many processes."""
    cores = len(os.sched_getaffinity(0))
    sides = (128,) if quick else (128, 256)
    fields = {side: (table6(1500.0).speed(side, TABLE6_SIDE_M), TABLE6_SIDE_M / (side - 1)) for side in sides}
    deep = 48 if quick else 160
    volume = np.random.default_rng(8).uniform(1400.0, 1600.0, (deep,) * 3)
    np.save(folder / "volume.npy", volume)
    alone = least(lambda: eikonal.solve(volume, 1e-3, (0.02, 0.02, 0.02), "fsm"), 1 if quick else RUNS)
    for count, (along_x, along_y) in PROCESSES.items():
        if quick and count != 2:
            continue
        more = f", oversubscribed: {cores} cores" if count > cores else ""
        with open_cluster(workers=count, local_directory=folder) as cluster:
            for side, (speed, spacing) in fields.items():
                progress(count, 8, f"{side}² in blocks on {count} processes")
                source = (0.1 * TABLE6_SIDE_M, 0.5 * TABLE6_SIDE_M)
                run = in_blocks(cluster, speed, spacing, source, (along_x, along_y))
                found = least(run, RUNS)
                single = least(partial(eikonal.solve, speed, spacing, source, "fsm"), RUNS)
                detail = (
                    f"{along_x} by {along_y} blocks; alone without a cluster "
                    f"{1e3 * single:.3g} ms; theirs {1e3 * THEIRS_S[side]:g} ms on 8 nodes, 2008{more}"
                )
                yield Row(
                    f"Table 8 {side}² FSM cluster, {count} processes",
                    found,
                    THEIRS_S[side],
                    "<=",
                    "s",
                    detail,
                )
            run = in_blocks(cluster, folder / "volume.npy", 1e-3, (0.02,) * 3, (along_x, along_y, 1))
            found = least(run, 1 if quick else RUNS)
            detail = f"{along_x} by {along_y} by 1 blocks {found:.2f} s, whole {alone:.2f} s{more}"
            yield Row(
                f"FSM in blocks {deep}³ on {count} processes, speed-up", alone / found, 1.0, ">=", "", detail
            )


def in_blocks(cluster: Cluster, *arguments: Any) -> Callable[[], object]:
    """A solve whose blocks stay on their workers."""

    return partial(solve_in_blocks, cluster.client, *arguments)


def least(run: Callable[[], object], runs: int) -> float:
    """Least seconds of some runs, after one that is not counted."""
    run()
    return min(seconds(run) for _ in range(runs))


def seconds(run: Callable[[], object]) -> float:
    """That one run takes."""
    begun = time.perf_counter()
    run()
    return time.perf_counter() - begun

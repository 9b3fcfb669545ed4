"""One fast-sweeping solve on several cores: sub-domains on workers (Table 8, cluster), and threads in 3-D."""

import os
import tempfile
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter

from bentray_kernels import eikonal
from bentray_kernels.arrays import Floats
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step
from bentray_workers.cluster.connection import Cluster, open_cluster
from bentray_workers.reconstruction.subdomains import solve_in_blocks, solve_many_in_blocks

from .distributed import least

# Processes and blocks along each axis in the column of Table 8; the machine may have fewer cores.
PROCESSES: dict[int, tuple[int, int]] = {1: (1, 1), 2: (2, 1), 4: (2, 2), 8: (4, 2)}
THEIRS_S = {128: 0.007, 256: 0.039}
RUNS = 2

# "A 3.5-fold speed-up" on four cores (section 7.2.3); sub-domains are to keep this part of their cores busy.
THREADS_EFFICIENCY, BLOCKS_EFFICIENCY = 3.5 / 4.0, 0.8

# Transducers on a ring round the volume, and fields that are computed at the same time at most.
SOURCES, RADIUS, MOST_AT_ONCE = 8, 0.48, 4
SPACING_M = 1e-3


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """One projection, and a volume, in blocks on workers of this machine; ``quick`` takes two processes."""
    with tempfile.TemporaryDirectory() as name:
        yield from measured(Path(name), context.quick, context.progress)


def measured(folder: Path, quick: bool, progress: Step) -> Iterable[Row]:
    """Rows by number of processes, each with its own cluster on this machine."""
    cores = len(os.sched_getaffinity(0))
    sides = (128,) if quick else (128, 256)
    fields = {side: (table6(1500.0).speed(side, TABLE6_SIDE_M), TABLE6_SIDE_M / (side - 1)) for side in sides}
    deep = 48 if quick else 256
    media, sources = volumes(deep), ring(deep, 2 if quick else SOURCES)
    alone = {}
    for name, volume in media.items():
        progress(0, 8, f"{deep}³, {name}, alone")
        np.save(folder / f"{name}.npy", volume)
        alone[name] = least(partial(solve_all, volume, sources), 1)
        yield from threads(name, volume, sources[:1], cores)
    for count, (along_x, along_y) in PROCESSES.items():
        if quick and count != 2:
            continue
        more = f", oversubscribed: {cores} cores" if count > cores else ""
        with open_cluster(workers=count, local_directory=folder) as cluster:
            for side, (speed, spacing) in fields.items():
                progress(count, 8, f"{side}² in blocks on {count} processes")
                source = (0.1 * TABLE6_SIDE_M, 0.5 * TABLE6_SIDE_M)
                blocks = along_x, along_y
                run = partial(solve_in_blocks, cluster.client, speed, spacing, source, blocks)
                least_s = least(run, RUNS)
                single = least(partial(eikonal.solve, speed, spacing, source, "fsm"), RUNS)
                detail = (
                    f"{along_x} by {along_y} blocks; alone without a cluster "
                    f"{1e3 * single:.3g} ms; theirs {1e3 * THEIRS_S[side]:g} ms on 8 nodes, 2008{more}"
                )
                yield Row(
                    f"Table 8 {side}² FSM cluster, {count} processes",
                    least_s,
                    THEIRS_S[side],
                    "<=",
                    "s",
                    detail,
                )
            for name, seconds in alone.items():
                progress(count, 8, f"{deep}³, {name}, in blocks on {count} processes")
                yield in_space(cluster, folder / f"{name}.npy", sources, count, seconds, more)


def volumes(nodes: int) -> dict[str, Floats]:
    """Speeds (nodes, nodes, nodes), m/s: smooth as tissue, and noise, in which fronts turn more often."""
    random = np.random.default_rng(8)
    noise = random.standard_normal((nodes,) * 3)
    smooth = gaussian_filter(noise, nodes / 20.0)
    return {
        "smooth": 1500.0 + 50.0 * smooth / np.abs(smooth).max(),
        "noise": random.uniform(1400.0, 1600.0, (nodes,) * 3),
    }


def ring(nodes: int, count: int) -> Floats:
    """Places on a ring in the middle plane, (count, 3), m."""
    angle = 2.0 * np.pi * (np.arange(count) + 0.3) / count
    flat = 0.5 + RADIUS * np.stack((np.cos(angle), np.sin(angle), 0.0 * angle), axis=1)
    return np.asarray(flat * (nodes - 1) * SPACING_M)


def solve_all(volume: Floats, sources: Floats, method: str = "fsm", **options: Any) -> None:
    """One solve after the other in this process."""
    for source in sources:
        eikonal.solve(volume, SPACING_M, source, method, **options)


def threads(name: str, volume: Floats, sources: Floats, cores: int) -> Iterable[Row]:
    """One solve that threads share; and the published way, each thread a copy and an order."""
    single = least(partial(solve_all, volume, sources), RUNS)
    several = least(partial(solve_all, volume, sources, threads=cores), RUNS)
    yield Row(
        f"FSM {volume.shape[0]}³, {name}, shared by {cores} threads, speed-up",
        single / several,
        THREADS_EFFICIENCY * cores,
        ">=",
        "",
        f"one source; one thread {single:.2f} s, {cores} threads {several:.2f} s; theirs 3.5 on four cores",
    )
    alone = least(partial(solve_all, volume, sources, method="fsm-simultaneous"), 1)
    together = least(partial(solve_all, volume, sources, method="fsm-simultaneous", threads=cores), 1)
    yield Row(
        f"FSM {volume.shape[0]}³, {name}, all orders at the same time as published, over shared by threads",
        together / several,
        1.0,
        ">=",
        "",
        f"one source, {cores} threads; published: one thread {alone:.2f} s, {cores} threads {together:.2f} s",
    )


def in_space(cluster: Cluster, file: Path, sources: Floats, count: int, alone: float, more: str) -> Row:
    """Fields of several sources in blocks, beside the same solves in one process."""
    blocks = (*PROCESSES[count], 1)

    def run() -> int:
        fields = solve_many_in_blocks(
            cluster.client, file, SPACING_M, sources, blocks, at_once=min(count, MOST_AT_ONCE)
        )
        return sum(field.rounds for field in fields)

    seconds = least(run, 1)
    nodes = len(np.load(file, mmap_mode="r"))
    return Row(
        f"FSM in blocks {nodes}³, {file.stem}, on {count} processes, speed-up",
        alone / seconds,
        BLOCKS_EFFICIENCY * count,
        ">=",
        "",
        f"{len(sources)} sources, {blocks[0]} by {blocks[1]} by 1 blocks {seconds:.2f} s; "
        f"one process without blocks {alone:.2f} s{more}",
    )

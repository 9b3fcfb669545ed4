"""Fast sweeping in sub-domains on workers: the cluster column of Table 8, and the speed-up in 3-D."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bentray_kernels import eikonal
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step
from bentray_workers.cluster.connection import Cluster, open_cluster
from bentray_workers.reconstruction.subdomains import solve_in_blocks

from .distributed import least

# Processes and blocks along each axis in the column of Table 8; the machine may have fewer cores.
PROCESSES: dict[int, tuple[int, int]] = {1: (1, 1), 2: (2, 1), 4: (2, 2), 8: (4, 2)}
THEIRS_S = {128: 0.007, 256: 0.039}
RUNS = 2


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """One projection, and a volume, in blocks on workers of this machine; ``quick`` takes two processes."""
    with tempfile.TemporaryDirectory() as name:
        yield from blocks(Path(name), context.quick, context.progress)


def blocks(folder: Path, quick: bool, progress: Step) -> Iterable[Row]:
    """Rows by number of processes, each with its own cluster on this machine."""
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

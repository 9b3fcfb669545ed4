"""SART of a volume in blocks beside the whole volume: memory, time, difference and image error."""

import time
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bentray_kernels import eikonal, rays
from bentray_kernels.acquisition import Dataset
from bentray_kernels.arrays import Floats
from bentray_kernels.tomography import Reconstruction, Settings
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_workers.cluster.capacities import MIB
from bentray_workers.cluster.connection import open_cluster
from bentray_workers.files.dataset import write_dataset
from bentray_workers.files.dataset.scan import counts_in
from bentray_workers.reconstruction.planning import plan
from bentray_workers.reconstruction.reconstruction_run import reconstruct

from ._worker_use import forget_peak, of_worker, peak_bytes

WATER_MPS, RADIUS_M = 1500.0, 0.054
# Four rings that receive each other; side of the medium, m.
HEIGHTS_M, SIDE_M = np.array([-0.05, -0.017, 0.017, 0.05]), 0.12
BLOCKS = (2, 4)

# Largest relative difference of the speed; time and image error over those of the whole volume; memory over
# the part of the volume that is in a block.
DIFFERENCE, TIME, ERROR, MEMORY = 1e-10, 2.0, 1.05, 1.0


class Run(NamedTuple):
    """A reconstruction in a worker process of its own.

    Attributes:
        result: the images.
        memory: largest resident memory of the worker above that of a warm one, bytes.
        seconds: wall-clock time.
    """

    result: Reconstruction
    memory: int
    seconds: float


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Blocks of a sphere with a lesion; ``quick`` takes a small volume."""
    nodes, elements = (40, 4) if context.quick else (96, 8)
    with context.temporary_folder() as folder:
        path = folder / "scan.h5"
        write_dataset(path, scan(elements, 31 if context.quick else 61))
        # Few iterations in a short time; with the default relaxation of 0.1 the image is still water.
        common = {"method": "sart", "decomposition": "volume", "iterations": 2, "relaxation": 0.5}
        settings = Settings.from_values(nodes=nodes, **common)
        ways = {
            "whole": settings.changed(eikonal="fsm"),
            "accurate": settings,
            **{f"{blocks} blocks": settings.changed(blocks=blocks) for blocks in BLOCKS},
        }
        runs = {}
        for number, (name, settings_of_run) in enumerate(ways.items()):
            context.progress(number, len(ways), f"{nodes}², {name}")
            runs[name] = measured(folder, path, settings_of_run)
        for blocks in BLOCKS:
            yield from compared(path, ways[f"{blocks} blocks"], runs[f"{blocks} blocks"], runs)


def compared(path: Path, settings: Settings, divided: Run, runs: dict[str, Run]) -> Iterable[Row]:
    """Rows of one number of blocks."""
    whole, default = runs["whole"], runs["accurate"]
    planned = plan(counts_in(path).summary(settings), settings, ())
    undivided = plan(counts_in(path).summary(settings), settings.changed(blocks=1), ())
    shape = " x ".join(str(n) for n in whole.result.speed.shape)
    name = f"SART of a volume of {shape} in {settings.numerics.blocks} blocks"
    yield Row(
        f"{name}: memory of a worker over the whole volume",
        divided.memory / whole.memory,
        MEMORY / settings.numerics.blocks,
        "<=",
        "",
        f"above a warm worker {divided.memory / MIB:.0f} and {whole.memory / MIB:.0f} MiB, planned "
        f"{planned.largest[1] / MIB:.0f} and {undivided.largest[1] / MIB:.0f} MiB",
    )
    difference = np.abs(divided.result.speed / whole.result.speed - 1.0).max()
    yield Row(f"{name}: largest relative difference", float(difference), DIFFERENCE, "<=", "", "both by fsm")
    yield Row(
        f"{name}: time over the whole volume",
        divided.seconds / whole.seconds,
        TIME,
        "<=",
        "",
        f"one worker, {divided.seconds:.0f} and {whole.seconds:.0f} s",
    )
    own, theirs = error(divided.result), error(default.result)
    water = error(default.result, WATER_MPS)
    yield Row(
        f"{name}: image error over that of the default with the whole volume",
        own / theirs,
        ERROR,
        "<=",
        "",
        f"rms inside the sphere {own:.2f} m/s by fsm in blocks, {theirs:.2f} m/s by accurate, "
        f"{water:.2f} m/s of water alone; two iterations, relaxation 0.5",
    )


def measured(folder: Path, path: Path, settings: Settings) -> Run:
    """Reconstruct in a worker process, which has loaded its compiled code before."""
    with open_cluster(workers=1, local_directory=folder) as cluster:
        reconstruct(cluster.client, path, settings.changed(nodes=24))
        of_worker(cluster.client, forget_peak)
        warm = of_worker(cluster.client, peak_bytes)
        started = time.perf_counter()
        result = reconstruct(cluster.client, path, settings)
        seconds = time.perf_counter() - started
        return Run(result, of_worker(cluster.client, peak_bytes) - warm, seconds)


def scan(elements: int, nodes: int) -> Dataset:
    """Times of all pairs of four rings around the sphere, by second-order fronts in a grid of its own."""
    spacing = SIDE_M / (nodes - 1)
    line = spacing * np.arange(nodes) - SIDE_M / 2
    speed = truth(*np.meshgrid(line, line, line, indexing="ij"))
    angle = 2 * np.pi * (np.arange(elements)[None] + 0.25 * np.arange(4)[:, None]) / elements
    height = np.broadcast_to(HEIGHTS_M[:, None], angle.shape)
    position = np.stack((RADIUS_M * np.cos(angle), RADIUS_M * np.sin(angle), height), axis=-1).reshape(-1, 3)
    corner, every = SIDE_M / 2, np.arange(len(position))
    delta = np.full((every.size,) * 2, np.nan)
    for k, source in enumerate(position):
        tof = eikonal.solve(speed, spacing, source + corner)
        lengths = rays.sensitivities(tof, spacing, position + corner, source + corner)
        delta[k] = lengths @ (1.0 / speed).ravel() - np.linalg.norm(position - source, axis=1) / WATER_MPS
        delta[k, k] = np.nan
    return Dataset(position, every, every, WATER_MPS, delta_tof_s=delta)


def truth(x: Floats, y: Floats, z: Floats) -> Floats:
    """Speed at some places, m/s: a slow sphere with a fast lesion in water."""
    speed = np.full(x.shape, WATER_MPS)
    speed[x**2 + y**2 + z**2 < 0.03**2] = 1460.0
    speed[(x - 0.01) ** 2 + y**2 + (z - 0.005) ** 2 < 0.011**2] = 1540.0
    return speed


def error(result: Reconstruction, value: float | None = None) -> float:
    """Rms error inside the sphere, m/s, of the image or of one value."""
    lines = [
        origin + spacing * np.arange(n)
        for n, spacing, origin in zip(result.speed.shape, result.spacing_m, result.origin_m, strict=True)
    ]
    x, y, z = np.meshgrid(*lines, indexing="ij")
    inside = x**2 + y**2 + z**2 < 0.03**2
    speed = result.speed if value is None else np.full(x.shape, value)
    return float(np.sqrt(np.mean((speed - truth(x, y, z))[inside] ** 2)))

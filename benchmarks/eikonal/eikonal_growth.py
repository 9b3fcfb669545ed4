"""Complexity: growth of time and memory with the grid, for every CPU method in 2-D and 3-D."""

import json
import subprocess
import sys
import time
from collections.abc import Iterable
from functools import partial
from pathlib import Path

import numpy as np

from bentray_kernels import eikonal
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

from ..shared._timing import least_seconds
from .eikonal import gradient

# Nodes along a side, by dimensions.
SIDES = {2: (64, 128, 256, 512, 1024, 2048), 3: (32, 48, 64, 96, 128, 192)}
QUICK_SIDES = {2: (64, 128, 256, 512), 3: (32, 48, 64)}

# A fit of the memory leaves out grids whose arrays are lost among the pages of a process.
MIN_NODES_FOR_MEMORY = 200_000

EXPONENT_GOAL = 1.15
BYTES_GOAL = 200.0


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """A row a method, dimension and quantity; speed 1 to 5 along x, one thread."""
    sides = QUICK_SIDES if context.quick else SIDES
    names = [name for name in eikonal.methods() if not eikonal.METHODS[name].on_device]
    cases = [(name, ndim) for ndim in sides for name in names]
    total = 2 * len(cases)
    for k, (name, ndim) in enumerate(cases):
        context.progress(2 * k, total, f"{name} {ndim}-D time")
        yield growth_of_time(name, ndim, sides[ndim])
        context.progress(2 * k + 1, total, f"{name} {ndim}-D memory")
        yield growth_of_memory(name, ndim, sides[ndim])
    context.progress(total, total, "done")


def growth_of_time(name: str, ndim: int, sides: tuple[int, ...]) -> Row:
    """The exponent of time against nodes, by least squares of the logarithms."""
    gradient(32, ndim).solve(name)
    # Processor time, which does not depend on the load of the machine.
    seconds = [least_seconds(partial(gradient(n, ndim).solve, name), time.process_time) for n in sides]
    nodes = [n**ndim for n in sides]
    exponent = float(np.polyfit(np.log(nodes), np.log(seconds), 1)[0])
    each = listed(sides, ndim, [1e9 * s / n for s, n in zip(seconds, nodes, strict=True)])
    detail = f"processor time, ns a node: {each}"
    return Row(f"{name} {ndim}-D time", exponent, EXPONENT_GOAL, "<=", "exponent", detail)


def growth_of_memory(name: str, ndim: int, sides: tuple[int, ...]) -> Row:
    """Bytes that one node more takes at the peak: the slope of a straight line through the grids."""
    large = [n for n in sides if n**ndim >= MIN_NODES_FOR_MEMORY]
    grids = ["x".join([str(n)] * ndim) for n in large]
    script = Path(__file__).parents[1] / "shared" / "_peak_memory.py"
    done = subprocess.run(
        [sys.executable, str(script), name, *grids], capture_output=True, text=True, check=False
    )
    label, unit = f"{name} {ndim}-D memory", "bytes/node"
    if done.returncode != 0:
        reason = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
        return Row(label, None, BYTES_GOAL, "<=", unit, f"not measured: {reason}")
    peaks = np.array(json.loads(done.stdout), dtype=float)
    nodes = np.array([float(n**ndim) for n in large])
    each = listed(large, ndim, list(peaks / nodes))
    # A single grid, as in a quick run, has no slope.
    slope = np.polyfit(nodes, peaks, 1)[0] if len(large) > 1 else peaks[0] / nodes[0]
    detail = f"peak of a process beyond the speed; bytes a node: {each}"
    return Row(label, float(slope), BYTES_GOAL, "<=", unit, detail)


def listed(sides: Iterable[int], ndim: int, values: list[float]) -> str:
    """``64² 50, 128² 48``."""
    power = {2: "²", 3: "³"}[ndim]
    return ", ".join(f"{n}{power} {value:.0f}" for n, value in zip(sides, values, strict=True))

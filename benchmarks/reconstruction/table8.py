"""Table 8 of the dissertation, the two rows of one projection: their times and ours."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from bentray_kernels import eikonal
from bentray_kernels.opencl import select_device
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

from ..shared._timing import least_seconds

SOURCES = 64
SIDES = (128, 256)


@dataclass(frozen=True)
class Column:
    """A column of Table 8.

    Attributes:
        name: solver and hardware, as the table heads them.
        hardware: what chapter 7.3 tells of it.
        seconds: of a projection, by nodes along a side.
        ours: the method that is put beside it.
    """

    name: str
    hardware: str
    seconds: dict[int, float]
    ours: str


COLUMNS = (
    Column("FMM CPU", "a 2.8 GHz Pentium 4", {128: 0.025, 256: 0.097}, "fmm"),
    Column("FSM CPU", "a CPU", {128: 0.031, 256: 0.180}, "fsm"),
    Column("FSM cluster", "a cluster of 8 nodes", {128: 0.007, 256: 0.039}, "fsm"),
    Column("FIM CPU", "a CPU", {128: 0.038, 256: 0.189}, "fim"),
    # The table's heading says 8086GTX, the text 8800 GTX.
    Column("FIM GPU 8800 GTX", "an NVIDIA 8800 GTX", {128: 0.00082, 256: 0.0023}, "fim-opencl"),
    Column("FIM GPU Tesla", "an NVIDIA Tesla", {128: 0.00072, 256: 0.0022}, "fim-opencl"),
)


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """A row a cell and a way to solve; ``quick`` covers 128²."""
    sides = SIDES[:1] if context.quick else SIDES
    names = tuple(dict.fromkeys(column.ours for column in COLUMNS))
    device, refusal = opencl()
    for i, nodes in enumerate(sides):
        figures_of: dict[str, dict[str, float]] = {}
        for k, name in enumerate(names):
            context.progress(i * len(names) + k, len(sides) * len(names), f"{name} {nodes}²")
            if device or not eikonal.METHODS[name].on_device:
                figures_of[name] = measured(name, nodes)
        for column in COLUMNS:
            ran_on = device if eikonal.METHODS[column.ours].on_device else "one core"
            yield from beside(column, nodes, figures_of.get(column.ours), ran_on, refusal)
    context.progress(len(sides) * len(names), len(sides) * len(names), "done")


def beside(
    column: Column, nodes: int, figures: dict[str, float] | None, ran_on: str, refusal: str
) -> Iterable[Row]:
    """Our figures beside one cell of the table."""
    goal = column.seconds[nodes]
    theirs = f"theirs {goal * 1e3:g} ms on {column.hardware}, 2008"
    label = f"Table 8 {nodes}² {column.name}"
    if figures is None:
        yield Row(label, None, goal, "<=", "s", f"no OpenCL device: {refusal}; {theirs}")
        return
    for way, seconds in figures.items():
        times = f"{goal / seconds:.3g} times as fast"
        how = f"{column.ours} {seconds * 1e3:.3g} ms on {ran_on}, {times}; {theirs}"
        yield Row(f"{label}, {way}", seconds, goal, "<=", "s", how)


def measured(name: str, nodes: int) -> dict[str, float]:
    """Seconds of a projection through the breast of Table 6 in water of 1500 m/s, emitters on a ring.

    Alone, and as one of many where the method takes many together.
    """
    speed = table6(1500.0).speed(nodes, TABLE6_SIDE_M)
    spacing = TABLE6_SIDE_M / (nodes - 1)
    angle = 2.0 * np.pi * np.arange(SOURCES) / SOURCES
    ring = TABLE6_SIDE_M * (0.5 + 0.475 * np.column_stack((np.cos(angle), np.sin(angle))))
    figures = {"single": least_seconds(lambda: eikonal.solve(speed, spacing, ring[0], name))}
    if eikonal.METHODS[name].batched:
        together = least_seconds(lambda: eikonal.solve_many(speed[None], spacing, ring, name))
        figures[f"of {SOURCES}"] = together / SOURCES
    return figures


def opencl() -> tuple[str, str]:
    """The device that ``fim-opencl`` runs on, empty where there is none, and why it is none."""
    choice = select_device()
    if choice.device is not None:
        return choice.device.label, ""
    return "", "; ".join(choice.refusals) or "this machine has none"

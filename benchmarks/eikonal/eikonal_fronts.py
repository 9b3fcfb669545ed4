"""Errors of every Eikonal method on two problems, with a figure of wave fronts and errors."""

from collections.abc import Iterable

import numpy as np

from bentray_kernels import eikonal
from bentray_kernels.opencl import select_device
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

from ._fronts_picture import Case, Solved, picture
from .eikonal import Problem, breast, gradient

# The breast's reference comes from a grid so many times finer. At the ring it differs by about 1 ns rms from
# that of a grid eight times finer.
REFINEMENT = 4

# First-order methods solve the equations of the goal, each up to its own tolerance.
SLACK = 1e-6


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Ring rms and largest ring error of each method, with a picture of the fronts.

    The goal is the error of first-order fast marching on the same grid: what solves the same equations
    otherwise should equal it, and what claims to be more accurate should stay below.
    """
    nodes = 128 if context.quick else 256
    device = select_device().device
    names = [name for name in eikonal.methods() if device or not eikonal.METHODS[name].on_device]
    makers = (breast_case, gradient_case)
    cases = []
    for k, make in enumerate(makers):
        context.progress(k, len(makers) + 1, make.__name__.replace("_case", ""))
        p, case = make(nodes, names)
        cases.append(case)
        first = p.ring(p.solve("fmm", order=1))
        for name in eikonal.methods():
            yield from errors(case, name, first)
    context.progress(len(makers), len(makers) + 1, "picture")
    context.save_picture("eikonal_fronts.png", lambda: picture(cases))
    context.progress(len(makers) + 1, len(makers) + 1, "done")


def errors(case: Case, name: str, first: np.ndarray) -> Iterable[Row]:
    """The two rows of a method; ``first`` are the ring errors of first-order fast marching, s."""
    measures = {
        "ring rms": lambda off: float(np.sqrt((off**2).mean())),
        "ring max": lambda off: float(np.abs(off).max()),
    }
    for kind, measure in measures.items():
        label, goal = f"{case.title} {name} {kind}", measure(first) * case.per_second * (1.0 + SLACK)
        if name in case.solved:
            value = measure(case.solved[name].ring) * case.per_second
            detail = f"{value / goal:.2g} of first-order fast marching"
            yield Row(label, value, goal, "<=", case.unit, detail)
        else:
            yield Row(label, None, goal, "<=", case.unit, "no OpenCL device can be used")


def breast_case(nodes: int, names: Iterable[str]) -> tuple[Problem, Case]:
    """The breast; its true times are those of a finer grid, read at the nodes of this one."""
    p = breast(nodes, REFINEMENT)
    speed = breast(REFINEMENT * (nodes - 1) + 1, 1).speed
    fine = eikonal.solve(speed, p.spacing / REFINEMENT, p.source, "hafmm")
    true = fine[::REFINEMENT, ::REFINEMENT]
    return p, Case(f"breast {nodes}²", p, solved(p, names, true), "ns", 1e9, 10e-6, "10 µs")


def gradient_case(nodes: int, names: Iterable[str]) -> tuple[Problem, Case]:
    """Speed 1 + 4x, where the true time is known: arccosh(1 + 16 d² / (2 v v₀)) / 4."""
    p = gradient(nodes, 2)
    axis = np.arange(nodes) * p.spacing
    squared = (axis[:, None] - p.source[0]) ** 2 + (axis[None, :] - p.source[1]) ** 2
    true = np.arccosh(1.0 + 8.0 * squared / (p.speed * p.speed[p.node])) / 4.0
    return p, Case(f"gradient {nodes}²", p, solved(p, names, true), "µs", 1e6, 0.05, "50 ms")


def solved(p: Problem, names: Iterable[str], true: np.ndarray) -> dict[str, Solved]:
    """Each method's times, their error at every node and at the ring."""
    times = {name: p.solve(name) for name in names}
    return {name: Solved(time, np.abs(time - true), p.ring(time)) for name, time in times.items()}

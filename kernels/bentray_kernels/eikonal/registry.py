"""Eikonal methods by name, and ``solve`` and ``solve_many``."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, refuse_mask
from ..errors import InvalidInput
from .accurate import accurate
from .fast_iterative import fast_iterative
from .fast_iterative_opencl import fast_iterative_opencl
from .fast_marching import fast_marching, high_accuracy_fast_marching
from .fast_marching_untidy import fast_marching_untidy
from .fast_sweeping import fast_sweeping
from .problem import PointSource, SlownessGrid
from .simultaneous_sweeps import simultaneous_sweeps


@dataclass(frozen=True)
class Method:
    """A solver and its properties.

    Attributes:
        name: of the method in requests.
        solver: takes a ``PointSource`` and keyword options, gives the travel time in the grid's shape; with
            ``batched`` it takes problems of one shape and spacing, and an array (batch, nx, ny[, nz]) to
            fill.
        order: order of accuracy away from shocks; the singularity of the point source limits it to 1 unless
            it is factored out.
        differences: order of the finite differences.
        factored: whether the source's singularity is factored out.
        batched: whether it solves several problems in a call.
        on_device: whether it parallelises a batch itself; threads must not share it.
    """

    name: str
    solver: Callable[..., Any]
    order: int
    differences: int
    factored: bool
    batched: bool = False
    on_device: bool = False

    def options(self) -> tuple[str, ...]:
        """Names of the keyword options that the solver takes."""
        kinds = inspect.signature(self.solver).parameters.values()
        return tuple(p.name for p in kinds if p.kind is inspect.Parameter.KEYWORD_ONLY)

    def run(self, problem: PointSource, **options: Any) -> Floats:
        """Travel time of one problem, (nx, ny[, nz]), s."""
        if not self.batched:
            return np.asarray(self.solver(problem, **options))
        times = np.empty((1, *problem.slowness.shape))
        self.solver([problem], times, **options)
        return np.asarray(times[0])


# Order of accuracy and of the differences, and whether the singularity is factored out.
FIRST, PLAIN, FACTORED = (1, 1, False), (1, 2, False), (2, 2, True)

_METHODS = (
    Method("accurate", accurate, *FACTORED),
    Method("fmm", fast_marching, *PLAIN),
    Method("hafmm", high_accuracy_fast_marching, *FACTORED),
    Method("fsm", fast_sweeping, *FIRST, batched=True),
    Method("fsm-simultaneous", simultaneous_sweeps, *FIRST),
    Method("fim", fast_iterative, *FIRST),
    Method("fim-opencl", fast_iterative_opencl, *FIRST, batched=True, on_device=True),
    Method("fmm-untidy", fast_marching_untidy, *PLAIN),
    # The fast marching of chapter 6.
    Method("fmm-first-order", lambda problem: fast_marching(problem, order=1), *FIRST),
)
METHODS: Mapping[str, Method] = MappingProxyType({method.name: method for method in _METHODS})


def methods() -> tuple[str, ...]:
    """Names that ``solve`` accepts, the default first."""
    return tuple(METHODS)


def solve(
    speed: ArrayLike, spacing: float, source: ArrayLike, method: str = "accurate", **options: Any
) -> Floats:
    """Travel time from a point source to every node: |∇T| = 1/speed (chapter 6, equation 2).

    Args:
        speed: (nx, ny[, nz]), m/s, finite and > 0.
        spacing: node spacing, m, the same along every axis.
        source: (ndim,), m, anywhere in the grid; node 0 lies at 0.
        method: one of ``methods()``.
        options: keyword options of that method. ``accurate`` takes ``supersample``: 2 or more solves on a
            grid that many times as fine.

    Returns:
        (nx, ny[, nz]), s, float64.

    Raises:
        InvalidInput: naming the argument: a speed that is not finite or not positive (with the place of
            the first), a source outside the grid, an unknown method or option.
    """
    chosen = _with_options(method, options)
    return chosen.run(PointSource.checked(speed, spacing, source), **options)


def solve_many(
    speeds: ArrayLike,
    spacing: float,
    sources: ArrayLike,
    method: str = "accurate",
    *,
    threads: int = 1,
    **options: Any,
) -> Floats:
    """Travel times of several problems in one call.

    Args:
        speeds: (batch, nx, ny[, nz]), m/s; a batch of 1 serves every source.
        spacing: node spacing, m.
        sources: (batch, ndim), m; a batch of 1 serves every speed.
        method: one of ``methods()``.
        threads: threads that share the batch; the times do not depend on their number. A method on
            a device takes the whole batch at once, whatever their number.
        options: keyword options of that method, the same for every solve.

    Returns:
        (batch, nx, ny[, nz]), s; each equal to ``solve`` of its own speed and source.

    Raises:
        InvalidInput: as ``solve``, and for batches that do not match.
    """
    chosen = _with_options(method, options)
    refuse_mask("speeds", speeds)
    refuse_mask("sources", sources)
    fields = np.asarray(speeds, dtype=np.float64)
    points = np.asarray(sources, dtype=np.float64)
    if fields.ndim not in (3, 4):
        raise InvalidInput("speeds", f"shape {fields.shape}", "(batch, nx, ny) or (batch, nx, ny, nz)")
    if points.ndim != 2:
        raise InvalidInput("sources", f"shape {points.shape}", "(batch, ndim)")
    if len(fields) != len(points) and 1 not in (len(fields), len(points)):
        raise InvalidInput("sources", f"a batch of {len(points)}", f"1 or as many as speeds, {len(fields)}")
    if threads < 1:
        raise InvalidInput("threads", threads, "a number >= 1")
    batch = max(len(fields), len(points)) if len(fields) and len(points) else 0
    times = np.empty((batch, *fields.shape[1:]))

    # One medium, checked and padded once, serves all its sources.
    shared = SlownessGrid.checked(fields[0], spacing) if len(fields) == 1 else None

    def problem(k: int) -> PointSource:
        medium = shared or SlownessGrid.checked(fields[k], spacing)
        return medium.source(points[k % len(points)])

    def solve_part(part: range) -> None:
        if chosen.batched:
            problems = map(problem, part)
            into = times[part.start : part.stop]
            chosen.solver(list(problems) if chosen.on_device else problems, into, **options)
        else:
            for k in part:
                times[k] = chosen.run(problem(k), **options)

    count = min(batch, 1 if chosen.on_device else threads)
    parts = [range(batch * k // count, batch * (k + 1) // count) for k in range(count)]
    if count == 1:
        solve_part(parts[0])
    elif count > 1:
        with ThreadPoolExecutor(count) as pool:
            # Raises the first exception of a thread, in order of the batch.
            list(pool.map(solve_part, parts))
    return times


def _with_options(name: str, options: Mapping[str, Any]) -> Method:
    if name not in METHODS:
        raise InvalidInput("method", repr(name), "one of " + ", ".join(METHODS))
    method = METHODS[name]
    for option in options:
        if option not in method.options():
            known = ", ".join(method.options()) or "none"
            raise InvalidInput("options", repr(option), f"options of {name}: {known}")
    return method

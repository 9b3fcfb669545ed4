"""Gauss–Newton with bent rays: all emitters at once, then one linear problem with total variation.

Unlike SART, where every emitter waits for the image of the one before, the emitters of an iteration are
independent: a slice can use as many workers as it has emitters.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Floats, Ints
from ..rays.fan import Kind
from .linearisation import Rows, linearise
from .matrix import back_project
from .problem import SliceProblem
from .result import Sweep
from .settings import Settings
from .total_variation import Linearised

# A misfit above this part of the one before ends the iteration: nothing is left to gain.
LEAST_GAIN = 0.98


@dataclass(frozen=True)
class Iterate:
    """Where an iteration stands; all that is needed to go on, to the bit.

    Attributes:
        slowness: (nodes, nodes), s/m.
        dual: (2, nodes, nodes), s, of the last linear problem.
        coverage: (nodes, nodes), metres of ray through each node.
        best: the image with the least misfit measured so far, and that misfit, s.
        done: whether nothing is left to do.
        history: a record per iteration, of the misfit that it began with.
        attenuation: (nodes, nodes), Np/m, once it is known; see ``attenuation``.
    """

    slowness: Floats
    dual: Floats
    coverage: Floats
    best: tuple[Floats, float]
    done: bool = False
    history: tuple[Sweep, ...] = ()
    attenuation: Floats | None = None

    @property
    def sweep(self) -> int:
        """Iterations finished."""
        return len(self.history)

    @property
    def emitter(self) -> int:
        """Emitters done in the iteration under way: none, for an iteration is one step."""
        return 0


def each_pair_once(problem: SliceProblem) -> SliceProblem:
    """The same problem without reverses, where every element is emitter and receiver: half the rays.

    Pairs measured both ways keep their mean. Each emitter keeps the half of the ring that follows it.
    """
    count = len(problem.emitters)
    if problem.emitters.shape != problem.receivers.shape or (problem.emitters != problem.receivers).any():
        return problem
    ahead = (np.arange(count)[None, :] - np.arange(count)[:, None]) % count
    half = (2 * ahead < count) & (ahead > 0)
    if count % 2 == 0:
        half |= (2 * ahead == count) & np.triu(np.ones((count, count), dtype=np.bool_))

    def once(data: Floats) -> Floats:
        both = np.where(np.isfinite(data), data, data.T)
        mean = np.where(np.isfinite(data.T), 0.5 * (both + data.T), both)
        return np.where(half, mean, np.nan)

    ratio = None if problem.log_ratio is None else once(problem.log_ratio)
    return replace(problem, delta_tof=once(problem.delta_tof), log_ratio=ratio)


def begin(problem: SliceProblem) -> Iterate:
    """Water everywhere."""
    shape = problem.region.shape
    slowness = np.full(shape, 1.0 / problem.water_speed)
    return Iterate(slowness, np.zeros((2, *shape)), np.zeros(shape), (slowness, math.inf))


def look(problem: SliceProblem, settings: Settings, slowness: Floats, sweep: int, emitters: Ints) -> Rows:
    """Rows of some emitters through an image; any split of the emitters gives the same.

    The first iteration (``sweep`` 0) goes along straight rays, which are those of the water it begins with.
    """
    rays: Kind = settings.rays if sweep else "straight"
    return linearise(problem, slowness, emitters, rays=rays, eikonal=settings.eikonal)


def step(
    problem: SliceProblem, settings: Settings, state: Iterate, parts: Sequence[Rows], slice_index: int = 0
) -> Iterate:
    """The next image from the rows of all emitters, in their order; at the end, the best of those measured.

    ``settings.sweeps`` passes make one image less, for the last one measures; a single pass makes one too,
    which nothing measures.

    The strength of the total variation follows the misfit: strong while rays are still wrong, so that their
    errors do not become structure, and in the end as weak as the data are exact.
    """
    residual = np.concatenate([part.residual for part in parts])
    rms = math.sqrt(float((residual**2).mean()))
    heard = int(np.isfinite(problem.delta_tof).any(axis=1).sum())
    record = Sweep(slice_index, len(state.history) + 1, rms, heard)
    history = (*state.history, record)
    best = (state.slowness, rms) if rms < state.best[1] else state.best
    stuck = len(history) > 1 and rms > LEAST_GAIN * state.best[1]
    # The last pass only measures what the one before gave.
    last = len(history) == settings.sweeps
    if len(history) > 1 and (stuck or last or rms <= settings.stop_rms_s):
        return replace(state, slowness=best[0], best=best, history=history, done=True)
    lowest, highest = settings.speed_bounds_mps
    coverage = _coverage(problem, parts)
    image, dual = Linearised(
        parts,
        state.slowness * problem.spacing,
        coverage[problem.region].mean() / problem.spacing,
        problem.region,
        (problem.spacing / highest, problem.spacing / lowest),
        settings.edge_cost * rms,
    ).solve(state.dual)
    return Iterate(
        np.where(problem.region, image / problem.spacing, state.slowness),
        dual,
        coverage,
        best,
        settings.sweeps == 1,
        history,
    )


def _coverage(problem: SliceProblem, parts: Sequence[Rows]) -> Floats:
    """Metres of ray through each node."""
    nodes = np.zeros(problem.region.size)
    for part in parts:
        back_project(part.pointers, part.columns, part.lengths, np.ones(part.residual.size), nodes)
    return nodes.reshape(problem.region.shape) * problem.spacing

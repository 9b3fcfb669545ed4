"""The wave simulator against k-Wave: dispersion, remaining differences, time."""

import os
import time
from collections.abc import Iterable

import numpy as np

from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

from ..shared._timing import alternate
from ._kwave_peer import Peer, installed, padded
from ._wave_picture import picture
from ._wave_shots import MEDIA, Shot, delays, misfit

# Nodes in the shortest wave: those of a refinement's grids, and those of ``bentray simulate``.
POINTS = (4.5, 7.0)
SIDE_M, QUICK_SIDE_M = 0.05, 0.025

# What was measured may exceed what was stated by this: the budget is for straight paths through one speed.
OVER_BUDGET = 1.05
# Of the traces, once the dispersion of water is put into the others as a refinement does.
REFINED = 0.01

# How often each of the two is timed, in turns.
TURNS = 5


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Two for each medium and grid, one of the time; with a picture of all."""
    peers, missing = installed()
    side_m = QUICK_SIDE_M if context.quick else SIDE_M
    shots = [Shot(name, points, side_m) for name in MEDIA for points in POINTS]
    shown = []
    for done, shot in enumerate(shots):
        context.progress(done, len(shots) + 1, f"{shot.name}, {shot.points:g} nodes")
        label = f"wave simulator against k-Wave, {shot.name}, {shot.points:g} nodes in a wave"
        if missing:
            yield Row(f"{label}, over the budget", None, OVER_BUDGET, "<=", "", missing["k-Wave"])
            yield Row(f"{label}, dispersion put in", None, REFINED, "<=", "", missing["k-Wave"])
            continue
        theirs = shot.theirs(peers["k-Wave"])
        ours = shot.ours()
        refined = shot.as_a_refinement(theirs)
        yield from judged(label, shot, (ours, theirs), refined)
        shown.append((shot, (ours, theirs), refined))
    context.progress(len(shots), len(shots) + 1, "time of a step")
    label = "wave simulator against k-Wave, time of a node and step"
    if missing:
        yield Row(label, None, 1.0, "<", "", missing["k-Wave"])
        return
    yield timed(label, next(shot for shot in shots if shot.name == "breast"), peers["k-Wave"])
    context.save_picture("wave_simulator.png", lambda: picture(shown))


def judged(
    label: str,
    shot: Shot,
    raw: tuple[np.ndarray, np.ndarray],
    refined: tuple[np.ndarray, np.ndarray],
) -> Iterable[Row]:
    """The rows of one shot; nothing is fitted, sources have the size that the equations give them."""
    ours, theirs = raw
    apart, late = misfit(ours, theirs), 1e9 * np.abs(delays(ours, theirs, shot.step))
    stated, delay = shot.budget(theirs)
    told = (
        f"traces differ by {apart:.4f} rms, stated {stated:.4f}; times by {np.median(late):.1f} ns in "
        f"the median, {late.max():.1f} at most, stated {1e9 * delay:.1f}; "
        f"{shot.nodes}² nodes, {shot.time.size} steps"
    )
    yield Row(f"{label}, over the budget", apart / stated, OVER_BUDGET, "<=", "", told)
    late = 1e9 * np.abs(delays(*refined, shot.step))
    told = f"times differ by {np.median(late):.2f} ns in the median, {late.max():.1f} at most"
    yield Row(f"{label}, dispersion put in", misfit(*refined), REFINED, "<=", "", told)


def timed(label: str, shot: Shot, peer: Peer) -> Row:
    """Ours over theirs, each for the nodes of its own grid, in turns, the quickest of each."""
    runs = {"ours": shot.ours, "theirs": lambda: shot.theirs(peer, 1)}
    grids = shot.medium.keep.size, padded(shot.nodes) ** 2
    seconds = alternate(runs, TURNS, time.process_time).values()
    least = [taken / (shot.time.size * grid) for taken, grid in zip(seconds, grids, strict=True)]
    told = (
        f"{1e9 * least[0]:.2f} ns against {1e9 * least[1]:.1f} ns of one core, {grids[0]} and {grids[1]} "
        f"nodes, float32, theirs with SciPy's transforms; load {os.getloadavg()[0]:.1f}"
    )
    return Row(label, least[0] / least[1], 1.0, "<", "", told)

"""Sentences about the geometry of a reconstruction: decomposition, pairs left out or leaving, directions."""

from collections.abc import Iterator, Mapping

import numpy as np
from scipy.ndimage import distance_transform_edt

from ..acquisition import Dataset
from ..acquisition.angular_coverage import angular_coverage
from ..arrays import Floats
from .directivity import within_opening
from .problem import RIM_NODES, Problem
from .settings import Settings

# Pairs that are followed, drawn evenly, and points on each.
MAX_PAIRS, POINTS = 20_000, 65

# A path leaves the region where it is farther from it than the rim at a corner of the hull, nodes.
BEYOND_NODES = 2 * RIM_NODES + 1


def geometry_summary(
    dataset: Dataset, settings: Settings, problem: Problem, reasons: Mapping[str, str]
) -> str:
    """Properties of the geometry of a reconstruction beyond the usual; empty for a plain ring.

    Args:
        dataset: the scan.
        settings: that are used.
        problem: of one slice, or the volume.
        reasons: of automatic decisions, see ``settled``.
    """
    sentences = [*_sentences(dataset, settings, problem)]
    if settings.decomposition == "volume" and "decomposition" in reasons:
        why = reasons["decomposition"].removeprefix("volume")
        sentences.insert(0, f"Reconstructed in 3-D (decomposition: volume){why}.")
    return " ".join(sentences)


def _sentences(dataset: Dataset, settings: Settings, problem: Problem) -> Iterator[str]:
    if settings.opening_angle_deg is not None:
        outside = ~within_opening(dataset, settings.opening_angle_deg)
        outside = outside[dataset.tx[:, None] != dataset.rx]
        yield (
            f"{outside.sum()} of {outside.size} pairs ({100.0 * outside.mean():.0f} %) are outside the "
            f"opening angle of {settings.opening_angle_deg:g}° and left out."
        )
    start, end = _paths(problem)
    leaving = _leaving(problem, start, end)
    if leaving.any():
        where = "the region of interest" if settings.roi else "the region that may change"
        yield (
            f"Warning: {round(leaving.mean() * len(start))} of {len(start)} pairs "
            f"({100.0 * leaving.mean():.0f} %) leave {where}, outside which all is taken to be water: "
            "an object there changes the image inside."
        )
    coverage = angular_coverage(problem.elements, start, end)
    if coverage is not None and coverage.limited:
        yield str(coverage)


def _paths(problem: Problem) -> tuple[Floats, Floats]:
    """Ends of the paths with travel times, (paths, ndim) each, m."""
    starts, ends = [], []
    for k in problem.active_emitters:
        received = problem.receivers_of(k)[np.isfinite(problem.delta_tof[k])]
        starts.append(np.broadcast_to(problem.emitters[k], received.shape))
        ends.append(received)
    return np.concatenate(starts), np.concatenate(ends)


def _leaving(problem: Problem, start: Floats, end: Floats) -> np.ndarray:
    """Whether some paths, drawn evenly, pass outside the region over more than the rim."""
    drawn = slice(None, None, -(-len(start) // MAX_PAIRS))
    far = distance_transform_edt(~problem.region) > BEYOND_NODES
    fraction = np.linspace(0.0, 1.0, POINTS)[:, None]
    points = start[drawn, None] + fraction * (end - start)[drawn, None]
    node = np.clip(np.rint(points / problem.spacing).astype(np.int64), 0, np.array(far.shape) - 1)
    return np.asarray(far[tuple(np.moveaxis(node, -1, 0))].any(axis=1))

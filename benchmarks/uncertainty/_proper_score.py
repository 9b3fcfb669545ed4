"""Continuous ranked probability score of standard deviations, and rows that compare it with a constant's."""

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import ndtr

from bentray_kernels.arrays import Floats
from bentray_service.cli.output.benchmark_row import Row

from ._judged_image import DEVIATIONS, Judged, sizes

# Of the best constant's score; and the least and the largest part of the nodes within two deviations.
SCORE, COVERED, NOT_MORE = 0.8, 0.85, 0.985

# A known error scores least with a deviation of this many times its size.
OF_KNOWN_ERROR = 1.2


def score(error: Floats, deviation: Floats) -> Floats:
    """Score of each node, m/s, for a Gaussian about the image (Gneiting and Raftery 2007, section 4.2).

    Args:
        error: (nodes,), of the image, m/s.
        deviation: (nodes,), standard deviations, m/s, above 0.
    """
    size = error / deviation
    density = np.exp(-0.5 * size**2) / np.sqrt(2.0 * np.pi)
    return np.asarray(deviation * (size * (2.0 * ndtr(size) - 1.0) + 2.0 * density - 1.0 / np.sqrt(np.pi)))


def best_constant(error: Floats) -> tuple[float, float]:
    """The one deviation, m/s, with the least mean score for these errors, and that score, m/s."""
    found = minimize_scalar(
        lambda logarithm: float(score(error, np.exp(logarithm)).mean()), bounds=(-7.0, 7.0), method="bounded"
    )
    return float(np.exp(found.x)), float(found.fun)


def score_rows(judged: Sequence[Judged], about: str) -> Iterable[Row]:
    """Rows U2: score and coverage of all nodes with a deviation, and the score of those in the breast.

    Args:
        judged: images of scans that chose nothing.
        about: the scans, and on what the settings of the deviations were chosen.
    """
    every = {
        image.name.split(":")[0]: np.abs(image.error) <= DEVIATIONS * image.deviation for image in judged
    }
    covered = {name: float(within.mean()) for name, within in every.items()}
    pooled = float(np.concatenate(list(every.values())).mean())
    fewest, most = min(covered, key=covered.__getitem__), max(covered, key=covered.__getitem__)
    spread = f"{about}; from {covered[fewest]:.3f} (scan {fewest}) to {covered[most]:.3f} (scan {most})"
    yield _compared("inside the array", [(image.error, image.deviation) for image in judged], about)
    yield Row("U2 nodes inside the array within two deviations, at least", pooled, COVERED, ">=", "", spread)
    yield Row("U2 nodes inside the array within two deviations, at most", pooled, NOT_MORE, "<=", "", spread)
    yield _compared("in the breast", [image.in_breast for image in judged], about)


def _compared(where: str, nodes: Sequence[tuple[Floats, Floats]], about: str) -> Row:
    """The row of the score over that of the best constant, of errors and deviations of each scan."""
    error, deviation = (np.concatenate(parts) for parts in zip(*nodes, strict=True))
    constant, least = best_constant(error)
    known = float(score(error, OF_KNOWN_ERROR * np.maximum(np.abs(error), 1e-9)).mean())
    return Row(
        f"U2 CRPS of the deviations over that of the best constant, nodes {where}",
        float(score(error, deviation).mean()) / least,
        SCORE,
        "<=",
        "",
        f"{about}; {error.size} nodes; best constant {constant:.1f} m/s, its CRPS {least:.2f} m/s; "
        f"deviations made of the errors themselves would have {known / least:.2f}; "
        f"{100.0 * np.mean(np.abs(error) <= DEVIATIONS * deviation):.0f} % within two deviations; "
        f"{sizes(error, deviation)}",
    )

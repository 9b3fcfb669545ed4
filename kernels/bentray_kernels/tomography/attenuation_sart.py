"""SART of the attenuation along the rays of the finished speed image (chapter 6.3, phase two)."""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import gaussian_filter

from ..arrays import Flags, Floats
from .gauss_newton.linearisation import Rows
from .settings import Settings


def solve(
    blocks: Sequence[Rows], water: Floats, region: Flags, settings: Settings, bounds: tuple[float, float]
) -> Floats:
    """The attenuation after ``settings.iterations`` iterations over all emitters (equation 1).

    After each emitter, in random order, all nodes on its rays are updated by the mean residual per length of
    the rays, weighted by the length of each in the node. The rays do not change.

    Args:
        blocks: rows of all emitters, in their order; residuals are log ratios minus those of water, Np.
        water: the image of the water, in which iterations start, (nx, ny[, nz]), Np per node.
        region: as ``water``, nodes that may change.
        settings: ``sart``, ``iterations`` and ``numerics``.
        bounds: lowest and highest attenuation, Np per node.

    Returns:
        as ``water``, Np per node.
    """
    image = water.copy()
    emitters = [rows for block in blocks for rows in block.by_emitter() if rows.residual.size]
    for iteration in range(settings.iterations):
        for k in np.random.default_rng((settings.numerics.seed, iteration)).permutation(len(emitters)):
            change = _smoothed(_update(emitters[k], image - water), settings.numerics.smoothing_nodes)
            moved = np.clip(image + settings.numerics.relaxation * change, *bounds)
            image[region] = moved[region]
    return image


def _update(rows: Rows, change: Floats) -> Floats:
    """The update of each node from one emitter; 0 off its rays."""
    length = rows.project(np.ones_like(change))
    passes = length > 0.0
    residual = rows.residual - rows.project(change)
    correction = np.divide(residual, length, out=np.zeros_like(residual), where=passes)
    sums, weights = np.zeros(change.size), np.zeros(change.size)
    rows.back_project(correction, sums)
    rows.back_project(np.ones_like(correction), weights)
    return np.divide(sums, weights, out=sums, where=weights > 0.0).reshape(change.shape)


def _smoothed(change: Floats, nodes: float) -> Floats:
    return np.asarray(gaussian_filter(change, nodes, mode="nearest") if nodes > 0.0 else change)

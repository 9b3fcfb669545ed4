"""Image and curvature of one frequency band on the grid of the next."""

import numpy as np
from scipy.ndimage import map_coordinates

from ...arrays import Flags, Floats
from .inversion_state import Curvature, Image
from .lbfgs import append_pair


def resampled(image: Image, spacing: float, origin: tuple[float, float], shape: tuple[int, ...]) -> Floats:
    """An image on another grid, (nx, ny), m/s; extrapolated by its outermost nodes."""
    lines = [
        (origin[axis] + spacing * np.arange(nodes) - image.origin[axis]) / image.spacing
        for axis, nodes in enumerate(shape)
    ]
    nodes = np.meshgrid(*lines, indexing="ij")
    # Cubic, because linear interpolation blurs at every change of grid; cubic may overshoot.
    speed = map_coordinates(image.speed, nodes, order=3, mode="nearest")
    return np.asarray(np.clip(speed, image.speed.min(), image.speed.max()))


def resampled_pairs(
    curvature: Curvature, high_hz: float, spacing: float, origin: tuple[float, float], region: Flags
) -> tuple[Floats, Floats]:
    """The pairs of a finished band as those of the next one, which contains its frequencies.

    With them the first step of a band has a direction and a length, and the inversion converges earlier.

    Args:
        curvature: of the finished band.
        high_hz: upper corner of the next one, Hz.
        spacing: of its nodes, m.
        origin: position of node 0, m.
        region: (nx, ny), nodes that it may change; steps and gradients are 0 elsewhere.

    Returns:
        Steps and changes, (pairs, nx, ny), oldest first, as ``lbfgs`` has them.
    """
    steps = changes = np.zeros((0, *region.shape))
    # The derivative by a node is in proportion to its area; the second derivative of the correlation of two
    # waves by their delay is in proportion to the square of the frequency.
    factor = (spacing / curvature.spacing * high_hz / curvature.high_hz) ** 2
    for step, change in zip(curvature.steps, curvature.changes, strict=True):
        moved, bent = (
            np.where(
                region,
                resampled(Image(image, curvature.spacing, curvature.origin), spacing, origin, region.shape),
                0.0,
            )
            for image in (step, change)
        )
        steps, changes = append_pair(steps, changes, moved, factor * bent)
    return steps, changes

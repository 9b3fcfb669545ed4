"""Interpolation of the truth at the nodes of a reconstruction."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import RegularGridInterpolator

from bentray_kernels.acquisition import Truth
from bentray_kernels.tomography import Reconstruction

Floats = NDArray[np.float64]

# Axis orders that can be permuted to x, y[, z]; any other text requires registration of the truth.
ORDERS = {"x,y": (0, 1), "y,x": (1, 0), "x,y,z": (0, 1, 2), "z,y,x": (2, 1, 0), "y,x,z": (1, 0, 2)}


class NotComparable(Exception):  # noqa: N818 - a property of the truth, not an error of the input
    """The truth cannot be interpolated on the image; the text is the reason to display."""


def on_grid(values: ArrayLike, truth: Truth, result: Reconstruction) -> Floats:
    """Linear interpolation of values on the grid of the truth at the nodes of the image.

    Args:
        values: of the shape of ``truth.sound_speed_mps``.
        truth: with the grid of the values.
        result: with the grid of the image.

    Returns:
        An array of the shape of ``result.speed``; NaN outside the truth.

    Raises:
        NotComparable: for axes that do not match.
    """
    order = ORDERS.get(truth.axes.replace(" ", ""))
    if order is None:
        raise NotComparable("the truth must be registered with the image first")
    if not len(order) == truth.sound_speed_mps.ndim == result.speed.ndim:
        raise NotComparable(
            f"the truth has axes {truth.axes} and {truth.sound_speed_mps.ndim} dimensions, "
            f"the image {result.speed.ndim}"
        )
    if not np.isfinite(result.spacing_m).all():
        raise NotComparable("the slices of the image are not evenly spaced")
    # Spacing and origin are listed in the order of the axes, too.
    lines = [
        truth.origin_m[a] + truth.spacing_m[a] * np.arange(truth.sound_speed_mps.shape[a]) for a in order
    ]
    x, y, *z = (
        o + h * np.arange(n)
        for o, h, n in zip(result.origin_m, result.spacing_m, result.speed.shape, strict=True)
    )
    known = np.asarray(values, np.float64).transpose(order)
    read = RegularGridInterpolator(lines, known, bounds_error=False, fill_value=np.nan)
    if not z:
        return np.asarray(read(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)))
    interpolated = np.empty(result.speed.shape)
    # Slice by slice, so that the coordinates of all nodes are never in memory at once.
    for k, place in enumerate(z[0]):
        interpolated[..., k] = read(np.stack(np.meshgrid(x, y, place, indexing="ij"), axis=-1))[..., 0]
    return interpolated

"""The truth read at the nodes of a reconstruction, where the two can be laid on each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator
from scipy.ndimage import binary_fill_holes

from bentray_kernels.acquisition import Truth
from bentray_kernels.tomography import Reconstruction

Floats = NDArray[np.float64]

# Orders of axes that can be brought to x, y[, z]; any other text means that the truth needs registration.
ORDERS = {"x,y": (0, 1), "y,x": (1, 0), "x,y,z": (0, 1, 2), "z,y,x": (2, 1, 0), "y,x,z": (1, 0, 2)}

# A true speed within this of the water's is water, m/s.
WATER_TOLERANCE_MPS = 1.0


def truth_on_grid(truth: Truth | None, result: Reconstruction, index: int) -> Floats | None:
    """True speed at the nodes of one slice, (nx, ny), m/s, by linear interpolation; NaN beyond the truth.

    None where there is no truth, its axes are not known, or it has no such slice.
    """
    if truth is None or truth.axes.replace(" ", "") not in ORDERS:
        return None
    order = ORDERS[truth.axes.replace(" ", "")]
    if len(order) != truth.sound_speed_mps.ndim or len(order) != result.speed.ndim:
        return None
    if not np.isfinite(result.spacing_m).all():
        return None
    # Spacing and origin are listed in the order of the axes, too.
    lines = [
        truth.origin_m[a] + truth.spacing_m[a] * np.arange(truth.sound_speed_mps.shape[a]) for a in order
    ]
    nodes = [
        o + h * np.arange(n)
        for o, h, n in zip(result.origin_m, result.spacing_m, result.speed.shape, strict=True)
    ]
    if len(nodes) == 3:
        nodes[2] = nodes[2][index : index + 1]
    read = RegularGridInterpolator(
        lines, truth.sound_speed_mps.transpose(order), bounds_error=False, fill_value=np.nan
    )
    points = np.stack(np.meshgrid(*nodes, indexing="ij"), axis=-1)
    return np.asarray(read(points).reshape(result.speed.shape[:2]))


def object_in(true_speed: Floats, water_speed_mps: float) -> NDArray[np.bool_]:
    """Nodes inside the outline of what is not water; every node of the truth if all of it is water."""
    known = np.isfinite(true_speed)
    other = known & (
        np.abs(np.where(known, true_speed, water_speed_mps) - water_speed_mps) > WATER_TOLERANCE_MPS
    )
    return np.asarray(binary_fill_holes(other) & known if other.any() else known)

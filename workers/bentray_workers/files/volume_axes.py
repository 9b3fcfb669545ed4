"""Reorientation of volumes: axes in the order and direction of space."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.arrays import Floats
from bentray_kernels.errors import InvalidInput

# Cosine between two axes; rounding in headers causes far less.
MAX_SHEAR = 1e-3
# Squares of longer steps overflow; no grid has them.
LARGEST = 1e100


def reorient(values: NDArray[Any], affine: Floats, field: str) -> tuple[NDArray[Any], Floats]:
    """Permute and flip axes to the order and direction of space; values are never resampled.

    Args:
        values: as stored; unchanged unless they have three axes.
        affine: (4, 4) from nodes to positions; unchanged without directions, ``Volume`` rejects it.
        field: with the directions in the file.

    Raises:
        InvalidInput: for axes that are not orthogonal.
    """
    from nibabel.orientations import apply_orientation, inv_ornt_aff, io_orientation

    # Comparisons with NaN are false.
    if values.ndim != 3 or not (np.abs(affine) < LARGEST).all():
        return values, affine
    lengths = np.linalg.norm(affine[:3, :3], axis=0)
    if not lengths.all():
        return values, affine
    axes = affine[:3, :3] / lengths
    cosine = float(np.abs(axes.T @ axes - np.eye(3)).max())
    if cosine > MAX_SHEAR:
        angle = math.degrees(math.acos(min(cosine, 1.0)))
        accepted = "orthogonal axes; resample the volume on such a grid"
        raise InvalidInput(field, f"a sheared grid: axes {angle:.2f} degrees apart", accepted)
    order = io_orientation(affine)
    return apply_orientation(values, order), affine @ inv_ornt_aff(order, values.shape)

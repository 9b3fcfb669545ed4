"""Volumes with their axes in the order of space, whichever way their file had them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.arrays import Floats
from bentray_kernels.errors import InvalidInput

# Cosine between two axes; rounding of headers leaves far less.
MOST_SHEAR = 1e-3
# Squares of longer steps leave the range of numbers; no grid has them.
LARGEST = 1e100


def turned(values: NDArray[Any], affine: Floats, field: str) -> tuple[NDArray[Any], Floats]:
    """The same with axes in the order and the sense of space; values are never resampled.

    Args:
        values: as the file has them; others than of three axes stay as they are.
        affine: (4, 4) from nodes to places; one without directions stays, for ``Volume`` to refuse.
        field: of the file that tells the directions.

    Raises:
        InvalidInput: for axes that are not at right angles.
    """
    from nibabel.orientations import apply_orientation, inv_ornt_aff, io_orientation

    # NaN is not below anything.
    if values.ndim != 3 or not (np.abs(affine) < LARGEST).all():
        return values, affine
    lengths = np.linalg.norm(affine[:3, :3], axis=0)
    if not lengths.all():
        return values, affine
    axes = affine[:3, :3] / lengths
    cosine = float(np.abs(axes.T @ axes - np.eye(3)).max())
    if cosine > MOST_SHEAR:
        angle = math.degrees(math.acos(min(cosine, 1.0)))
        accepted = "axes at right angles; resample the volume on such a grid"
        raise InvalidInput(field, f"a sheared grid: axes {angle:.2f} degrees apart", accepted)
    order = io_orientation(affine)
    return apply_orientation(values, order), affine @ inv_ornt_aff(order, values.shape)

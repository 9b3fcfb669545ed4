"""Axes of images in space: the convention, the grid of the nodes, and the reorientation of foreign axes.

Scan axes are RAS: x increases to the right of the body, y to the front (anterior), z to the head (superior),
as in NIfTI. Formats in LPS (left, posterior, superior: DICOM and MetaImage) hold the same values in the same
order, with directions and origin in LPS.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.arrays import Floats
from bentray_kernels.errors import InvalidInput

# From RAS to LPS and back.
LPS = np.diag([-1.0, -1.0, 1.0, 1.0])

# Cosine between two axes; rounding in headers causes far less.
MAX_SHEAR = 1e-3
# Directions this near to the axes of space are rounded ones: at 1 m they move a node by 10 um.
ALIGNED = 1e-5
# Squares of longer steps overflow; no grid has them.
LARGEST = 1e100


@dataclass(frozen=True)
class Grid:
    """Positions of the nodes of an image.

    Attributes:
        spacing_m: between nodes, per axis (x, y[, z]); NaN for uneven heights.
        origin_m: position of node 0, per axis, m.
        direction: (3, 3) orthonormal, one column for each axis of the array.
    """

    spacing_m: Sequence[float]
    origin_m: Sequence[float]
    direction: Floats = field(default_factory=lambda: np.eye(3))

    @property
    def oblique(self) -> bool:
        """True if an axis of the array is not along the axis of space of the same name."""
        return not np.array_equal(self.direction, np.eye(3))

    @property
    def tilt(self) -> str:
        """The largest angle between axes of the array and of space, in words; empty unless oblique."""
        cosine = float(np.diag(self.direction).min())
        angle = math.degrees(math.acos(min(max(cosine, -1.0), 1.0)))
        return f"turned by {angle:.2f} degrees against x, y and z" if self.oblique else ""

    def affine(self, unit_m: float = 1.0) -> Floats:
        """(4, 4) from nodes to positions, RAS; a plane lies at z = 0, as thick as its spacing along x.

        Args:
            unit_m: unit of the positions, m.
        """
        steps, corner = (*self.spacing_m, self.spacing_m[0])[:3], (*self.origin_m, 0.0)[:3]
        affine = np.eye(4)
        affine[:3, :3] = self.direction * np.divide(steps, unit_m)
        affine[:3, 3] = np.divide(corner, unit_m)
        return affine


class PositionedImage(NamedTuple):
    """Values (nx, ny, nz) of a foreign file, any real type, with their grid and title."""

    values: NDArray[Any]
    grid: Grid
    title: str


def check_aligned(grid: Grid, field: str, accepted: str) -> None:
    """Raise InvalidInput for an oblique grid, with its angle."""
    if grid.oblique:
        raise InvalidInput(field, f"a grid {grid.tilt}", accepted)


def reorient(values: NDArray[Any], affine: Floats, field: str) -> tuple[NDArray[Any], Grid]:
    """Permute and flip axes to the order and direction of space; values are never resampled.

    Args:
        values: (nx, ny, nz) as stored.
        affine: (4, 4) from nodes to positions, m, RAS.
        field: with the directions in the file.

    Returns:
        The values and their grid, whose directions keep a remaining tilt.

    Raises:
        InvalidInput: for axes that are not orthogonal.
    """
    from nibabel.orientations import apply_orientation, inv_ornt_aff, io_orientation

    with np.errstate(over="ignore"):
        lengths = np.linalg.norm(affine[:3, :3], axis=0)
    # ``Volume`` rejects what is not finite or 0. Comparisons with NaN are false.
    if not ((np.abs(affine) < LARGEST).all() and lengths.all()):
        return values, Grid(lengths.tolist(), affine[:3, 3].tolist())
    axes = affine[:3, :3] / lengths
    cosine = float(np.abs(axes.T @ axes - np.eye(3)).max())
    if cosine > MAX_SHEAR:
        angle = math.degrees(math.acos(min(cosine, 1.0)))
        accepted = "orthogonal axes; resample the volume on such a grid"
        raise InvalidInput(field, f"a sheared grid: axes {angle:.2f} degrees apart", accepted)
    order = io_orientation(affine)
    upright = affine @ inv_ornt_aff(order, values.shape)
    lengths = np.linalg.norm(upright[:3, :3], axis=0)
    direction = upright[:3, :3] / lengths
    if np.abs(direction - np.eye(3)).max() < ALIGNED:
        direction = np.eye(3)
    else:
        # The nearest orthonormal one.
        left, _, right = np.linalg.svd(direction)
        direction = left @ right
    return apply_orientation(values, order), Grid(lengths.tolist(), upright[:3, 3].tolist(), direction)

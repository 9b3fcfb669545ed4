"""The axis of a mesh or volume that is up in a picture: as requested, or that on which it stands."""

from collections.abc import Sequence
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.arrays import Floats
from bentray_kernels.requests.names import UpAxis
from bentray_kernels.splines import Spline

# Rotations of the object that turn an axis to z, exact.
UPRIGHT: dict[UpAxis, Floats] = {
    "z": np.eye(3),
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "x": np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]),
    "-z": np.diag([1.0, -1.0, -1.0]),
    "-y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "-x": np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]),
}

# What lies this near to the lowest point carries the object; a base has at least this area, and so many times
# that below z; relative to the largest extent.
BASE_HEIGHT, BASE_AREA, TIMES_Z = 0.02, 0.1, 3.0
# Nodes along the longest side of a volume that are examined, at most.
EXAMINED = 96

# That of each filtered volume in memory: every tile and preview asks for it.
_STANDING: WeakKeyDictionary[Spline, UpAxis] = WeakKeyDictionary()


def standing_axis(points: NDArray[Any]) -> UpAxis:
    """The axis that is up when an object stands on its largest base.

    Args:
        points: (n, 3) of the object, any unit.

    Returns:
        A key of ``UPRIGHT``.
    """
    extent = float(np.ptp(points, axis=0).max())
    areas = {}
    for axis, matrix in UPRIGHT.items():
        x, y, height = np.moveaxis(points @ matrix.T, 1, 0)
        base = height <= height.min() + BASE_HEIGHT * extent
        areas[axis] = float(np.ptp(x[base]) * np.ptp(y[base])) / extent**2
    largest = max(areas, key=areas.__getitem__)
    return largest if areas[largest] >= max(BASE_AREA, TIMES_Z * areas["z"]) else "z"


def standing_axis_of(spline: Spline, spacing_m: Sequence[float] | Floats) -> UpAxis:
    """The same of the upper half of the values of a filtered volume, by its coefficients.

    It is that of all iso-values, so that an object does not turn while these change.
    """
    if spline not in _STANDING:
        step = -(-max(spline.coefficients.shape) // EXAMINED)
        values = spline.coefficients[::step, ::step, ::step]
        upper = np.argwhere(values >= 0.5 * (values.min() + values.max()))
        _STANDING[spline] = standing_axis(upper * np.asarray(spacing_m))
    return _STANDING[spline]

"""A slice of a volume across any axis, with its position."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.arrays import Floats
from bentray_kernels.errors import InvalidInput

AXES = "xyz"
UPRIGHT = "z"


@dataclass(frozen=True)
class Plane:
    """A slice, with its first axis to the right and its second axis up.

    Attributes:
        image: (na, nb).
        names: of its two axes.
        spacing_m, origin_m: of these, m.
        across: name of the axis across the slice; empty for a 2-D image.
        index, count: index of the slice, and number of slices.
        place_m: position along that axis, m; NaN for uneven heights.
    """

    image: Floats
    names: str
    spacing_m: tuple[float, float]
    origin_m: tuple[float, float]
    across: str = ""
    index: int = 0
    count: int = 1
    place_m: float = math.nan

    def caption(self) -> str:
        """``slice index 2 (0 to 4), z = 6 mm``; empty for a 2-D image."""
        if not self.across:
            return ""
        position = "" if math.isnan(self.place_m) else f", {self.across} = {1e3 * self.place_m:.4g} mm"
        return f"slice index {self.index} (0 to {self.count - 1}){position}"


def plane_of(
    values: NDArray[Any],
    spacing_m: Sequence[float],
    origin_m: Sequence[float],
    axis: str = UPRIGHT,
    index: int | None = None,
) -> Plane:
    """A slice of a volume, or a 2-D image.

    Args:
        values: (nx, ny[, nz]).
        spacing_m, origin_m: per axis, m; NaN for uneven heights.
        axis: across the slice: x, y or z; z for a 2-D image.
        index: along the axis; None: the middle.

    Raises:
        InvalidInput: naming ``axis`` or ``index``.
    """
    count = values.shape[AXES.index(axis)] if values.ndim == 3 and axis in AXES else 1
    check_plane(values.shape, spacing_m, axis, index)
    if values.ndim == 2:
        return Plane(values.astype(np.float64), "xy", _pair(spacing_m, (0, 1)), _pair(origin_m, (0, 1)))
    across = AXES.index(axis)
    k = count // 2 if index is None else index
    shown = tuple(other for other in range(3) if other != across)
    return Plane(
        values.take(k, axis=across).astype(np.float64),
        AXES.replace(axis, ""),
        _pair(spacing_m, shown),
        _pair(origin_m, shown),
        axis,
        k,
        count,
        float(origin_m[across]) + k * float(spacing_m[across]),
    )


def check_plane(
    shape: Sequence[int], spacing_m: Sequence[float | None], axis: str, index: int | None
) -> None:
    """Reject a slice that does not exist, or cannot be drawn to scale; arguments as for ``plane_of``."""
    accepted = AXES if len(shape) == 3 else UPRIGHT
    if len(axis) != 1 or axis not in accepted:
        given = repr(axis) if len(shape) == 3 or axis not in AXES else f"{axis!r} of a 2-D image"
        raise InvalidInput("axis", given, " or ".join(accepted))
    uneven = spacing_m[-1] is None or not math.isfinite(spacing_m[-1])
    if axis != UPRIGHT and uneven:
        raise InvalidInput("axis", f"{axis!r} of slices at uneven heights", UPRIGHT)
    count = shape[AXES.index(axis)] if len(shape) == 3 else 1
    if index is not None and not 0 <= index < count:
        raise InvalidInput("index", index, f"0 to {count - 1}")


def _pair(values: Sequence[float], axes: Sequence[int]) -> tuple[float, float]:
    first, second = axes
    return float(values[first]), float(values[second])

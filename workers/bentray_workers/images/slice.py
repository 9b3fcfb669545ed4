"""The picture of one slice of a reconstruction file."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from bentray_kernels.errors import InvalidInput

from ..files.reconstruction import read_reconstruction
from .captions import LABELS, NAMES, facts
from .look import COLOUR_VALUE, Look
from .maps import RECOVERY_LIMITS, Limits, robust_limits
from .plane import UPRIGHT, plane_of
from .plane_picture import plane_png

# Of the larger of two limits, so much lies between them at least.
LEAST_SPAN = 1e-9


def slice_png(
    path: Path,
    *,
    quantity: str = "speed",
    axis: str = UPRIGHT,
    index: int | None = None,
    low: float | None = None,
    high: float | None = None,
    **look: Any,
) -> bytes:
    """One slice of a reconstruction file.

    Args:
        path: of ``reconstruction.h5``.
        quantity: ``speed``, ``coverage``, or ``attenuation`` or ``recovery`` where the file has it.
        axis: the one that the slice cuts across: x, y or z.
        index: along it; None: the middle one.
        low, high: values of the first and the last colour, in the quantity's unit; None: from the nodes
            that rays have passed, but for a few outliers; of the recovery 0 and 1.
        look: as the fields of ``Look``.

    Raises:
        InvalidInput: naming the argument, or the field of the file.
    """
    chosen = Look(**look)
    if quantity not in LABELS:
        raise InvalidInput("quantity", repr(quantity), "one of " + ", ".join(LABELS))
    result = read_reconstruction(path)
    volume = getattr(result, quantity)
    if volume is None:
        held = [name for name in LABELS if getattr(result, name) is not None]
        accepted = f"one of {', '.join(held)}: this file has no other"
        raise InvalidInput("quantity", repr(quantity), accepted)
    grid = (result.spacing_m, result.origin_m, axis, index)
    plane = plane_of(volume, *grid)
    passed = plane_of(result.coverage, *grid).image > 0.0
    limits = robust_limits([plane.image], passed if passed.any() else None)
    if quantity == "coverage":
        limits = (0.0, limits[1])
    elif quantity == "recovery":
        limits = RECOVERY_LIMITS
    title = ", ".join(filter(None, (NAMES[quantity], plane.where())))
    limits = given_limits(limits, low, high)
    return plane_png(plane, limits, chosen, title=title, unit=LABELS[quantity], note=facts(result))


def given_limits(limits: Limits, low: float | None, high: float | None) -> Limits:
    """The limits with what was asked for in their place.

    Raises:
        InvalidInput: for what no volume can hold, or is not clearly lower than the other.
    """
    for name, value in (("low", low), ("high", high)):
        if value is not None:
            COLOUR_VALUE.check(name, value)
    chosen = (limits[0] if low is None else low, limits[1] if high is None else high)
    # Colours need steps between the two that numbers of this size can tell apart.
    least = max(LEAST_SPAN * max(map(abs, chosen)), sys.float_info.min)
    if not chosen[1] - chosen[0] > least:
        if low is None:
            raise InvalidInput("high", high, f"a number above {chosen[0]:.6g}, or a low below it")
        raise InvalidInput("low", low, f"a number below {chosen[1]:.6g}")
    return chosen

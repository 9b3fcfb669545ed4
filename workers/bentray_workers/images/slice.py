"""The picture of one slice of a reconstruction or volume file."""

import sys
from pathlib import Path
from typing import Any

from bentray_kernels.arrays import Floats
from bentray_kernels.errors import InvalidInput

from ..files.reconstruction import read_reconstruction
from ..files.volume import read_volume
from .captions import LABELS, NAMES, facts
from .maps import FIXED_LIMITS, FROM_ZERO, Limits, robust_limits
from .plane import UPRIGHT, plane_of
from .plane_picture import plane_png
from .slice_style import COLOUR_VALUE, SliceStyle

# Smallest distance of the limits, relative to the larger of them.
MIN_SPAN = 1e-9


def slice_png(
    path: Path,
    *,
    quantity: str = "speed",
    axis: str = UPRIGHT,
    index: int | None = None,
    low: float | None = None,
    high: float | None = None,
    **style: Any,
) -> bytes:
    """One slice of a reconstruction file.

    Args:
        path: of ``reconstruction.h5``.
        quantity: ``speed``, ``coverage``, or ``attenuation``, ``recovery``, ``uncertainty`` or
            ``reflection`` if present.
        axis: across the slice: x, y or z.
        index: along the axis; None: the middle.
        low, high: values of the first and the last colour, in the unit of the quantity; None: the range
            of nodes with rays, without outliers; 0 and 1 for the recovery, -50 and 0 dB for the reflection.
        style: fields of ``SliceStyle``.

    Raises:
        InvalidInput: naming the argument, or the field of the file.
    """
    chosen = SliceStyle(**style)
    if quantity not in LABELS:
        raise InvalidInput("quantity", repr(quantity), "one of " + ", ".join(LABELS))
    result = read_reconstruction(path)
    image = result.image(quantity)
    if image is None:
        held = [name for name in LABELS if getattr(result, name) is not None]
        accepted = f"one of {', '.join(held)}: this file has no other"
        raise InvalidInput("quantity", repr(quantity), accepted)
    plane = plane_of(image.values, image.spacing_m, image.origin_m, axis, index)
    coverage = None
    if quantity not in FIXED_LIMITS:
        coverage = plane_of(result.coverage, result.spacing_m, result.origin_m, axis, index).image
    limits = usual_limits(quantity, plane.image, coverage)
    title = ", ".join(filter(None, (NAMES[quantity], plane.caption())))
    limits = requested_limits(limits, low, high)
    return plane_png(plane, limits, chosen, title=title, unit=LABELS[quantity], note=facts(result))


def volume_slice_png(
    path: Path,
    *,
    axis: str = UPRIGHT,
    index: int | None = None,
    low: float | None = None,
    high: float | None = None,
    **style: Any,
) -> bytes:
    """Like ``slice_png`` for the values of a volume file, with limits from the slice."""
    chosen = SliceStyle(**style)
    volume = read_volume(path)
    plane = plane_of(volume.values, volume.spacing_m, volume.origin_m, axis, index)
    limits = requested_limits(robust_limits([plane.image]), low, high)
    caption = plane.caption()
    title = caption[0].upper() + caption[1:]
    note = ", ".join(filter(None, (volume.title[:80], volume.grid.tilt)))
    return plane_png(plane, limits, chosen, title=title, unit="value", note=note)


def usual_limits(quantity: str, image: Floats, coverage: Floats | None) -> Limits:
    """The range of nodes with rays, without outliers; from 0 for ``FROM_ZERO``; or fixed limits.

    Args:
        quantity: as for ``slice_png``, or any name of other values.
        image: the slice.
        coverage: of the same nodes; None: unknown.
    """
    if quantity in FIXED_LIMITS:
        return FIXED_LIMITS[quantity]
    passed = None if coverage is None else coverage > 0.0
    limits = robust_limits([image], passed if passed is not None and passed.any() else None)
    return (0.0, limits[1]) if quantity in FROM_ZERO else limits


def requested_limits(limits: Limits, low: float | None, high: float | None) -> Limits:
    """The limits, replaced by requested ones.

    Raises:
        InvalidInput: for values out of range, or a low that is not below the high.
    """
    for name, value in (("low", low), ("high", high)):
        if value is not None:
            COLOUR_VALUE.check(name, value)
    chosen = (limits[0] if low is None else low, limits[1] if high is None else high)
    # Colours need distinguishable steps between the limits.
    least = max(MIN_SPAN * max(map(abs, chosen)), sys.float_info.min)
    if not chosen[1] - chosen[0] > least:
        if low is None:
            raise InvalidInput("high", high, f"a number above {chosen[0]:.6g}, or a low below it")
        raise InvalidInput("low", low, f"a number below {chosen[1]:.6g}")
    return chosen

"""The picture of one slice of a reconstruction file."""

from __future__ import annotations

import math
from pathlib import Path

from bentray_kernels.errors import InvalidInput

from ..reconstruction_file import read_reconstruction
from .canvas import drawing, new_figure, to_png
from .captions import LABELS, NAMES, facts, which_slice
from .cut import cut, slice_index
from .maps import RECOVERY_LIMITS, Limits, draw_bar, draw_map, robust_limits

COLORMAPS = ("viridis", "magma", "inferno", "plasma", "cividis", "gray", "bone", "turbo", "coolwarm")


def slice_png(
    path: Path,
    *,
    quantity: str = "speed",
    index: int | None = None,
    low: float | None = None,
    high: float | None = None,
    colormap: str = "viridis",
) -> bytes:
    """One slice of a reconstruction file.

    Args:
        path: of ``reconstruction.h5``.
        quantity: ``speed``, ``coverage``, or ``attenuation`` or ``recovery`` where the file has it.
        index: axial index; None: the middle one.
        low, high: values of the first and the last colour, in the quantity's unit; None: from the nodes
            that rays have passed, but for a few outliers; of the recovery 0 and 1.
        colormap: one of ``COLORMAPS``.

    Raises:
        InvalidInput: naming the argument, or the field of the file.
    """
    if colormap not in COLORMAPS:
        raise InvalidInput("colormap", repr(colormap), "one of " + ", ".join(COLORMAPS))
    if quantity not in LABELS:
        raise InvalidInput("quantity", repr(quantity), "one of " + ", ".join(LABELS))
    result = read_reconstruction(path)
    volume = getattr(result, quantity)
    if volume is None:
        held = [name for name in LABELS if getattr(result, name) is not None]
        accepted = f"one of {', '.join(held)}: this file has no other"
        raise InvalidInput("quantity", repr(quantity), accepted)
    k = slice_index(result, index)
    image = cut(volume, k)
    passed = cut(result.coverage, k) > 0.0
    limits = robust_limits([image], passed if passed.any() else None)
    if quantity == "coverage":
        limits = (0.0, limits[1])
    elif quantity == "recovery":
        limits = RECOVERY_LIMITS
    limits = given_limits(limits, low, high)
    with drawing():
        figure = new_figure(6.6, 5.9)
        axes = figure.subplots()
        title = f"{NAMES[quantity]}{which_slice(result, k)}"
        shown = draw_map(
            axes, image, result.spacing_m, result.origin_m, limits, colormap=colormap, title=title
        )
        draw_bar([shown], LABELS[quantity])
        figure.supxlabel(facts(result), fontsize=8, color="#666666")
        return to_png(figure)


def given_limits(limits: Limits, low: float | None, high: float | None) -> Limits:
    """The limits with what was asked for in their place.

    Raises:
        InvalidInput: for what is not finite, or not lower than the other.
    """
    for name, value in (("low", low), ("high", high)):
        if value is not None and not math.isfinite(value):
            raise InvalidInput(name, value, "a finite number")
    chosen = (limits[0] if low is None else low, limits[1] if high is None else high)
    if not chosen[0] < chosen[1]:
        if low is None:
            raise InvalidInput("high", high, f"a number above {chosen[0]:.6g}, or a low below it")
        raise InvalidInput("low", low, f"a number below {chosen[1]:.6g}")
    return chosen

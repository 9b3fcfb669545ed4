"""The picture of one slice of a volume file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..files.volume import read_volume
from .maps import robust_limits
from .plane import UPRIGHT, plane_of
from .plane_picture import plane_png
from .slice import given_limits
from .slice_style import SliceStyle


def volume_slice_png(
    path: Path,
    *,
    axis: str = UPRIGHT,
    index: int | None = None,
    low: float | None = None,
    high: float | None = None,
    **style: Any,
) -> bytes:
    """One slice of an uploaded volume.

    Args:
        path: of a volume file.
        axis: across the slice: x, y or z.
        index: along the axis; None: the middle.
        low, high: values of the first and the last colour; None: the range of the slice without outliers.
        style: fields of ``SliceStyle``.

    Raises:
        InvalidInput: naming the argument, or the field of the file.
    """
    chosen = SliceStyle(**style)
    volume = read_volume(path)
    plane = plane_of(volume.values, volume.spacing_m, volume.origin_m, axis, index)
    limits = given_limits(robust_limits([plane.image]), low, high)
    caption = plane.caption()
    title = caption[0].upper() + caption[1:]
    return plane_png(plane, limits, chosen, title=title, unit="value", note=volume.title[:80])

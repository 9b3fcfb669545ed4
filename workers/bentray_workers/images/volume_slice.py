"""The picture of one slice of a volume file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..files.volume import read_volume
from .look import Look
from .maps import robust_limits
from .plane import UPRIGHT, plane_of
from .plane_picture import plane_png
from .slice import given_limits


def volume_slice_png(
    path: Path,
    *,
    axis: str = UPRIGHT,
    index: int | None = None,
    low: float | None = None,
    high: float | None = None,
    **look: Any,
) -> bytes:
    """One slice of an uploaded volume.

    Args:
        path: of a file as ``files.volume.write_volume`` writes it.
        axis: the one that the slice cuts across: x, y or z.
        index: along it; None: the middle one.
        low, high: values of the first and the last colour; None: from the slice, but for a few outliers.
        look: as the fields of ``Look``.

    Raises:
        InvalidInput: naming the argument, or the field of the file.
    """
    chosen = Look(**look)
    volume = read_volume(path)
    plane = plane_of(volume.values, volume.spacing_m, volume.origin_m, axis, index)
    limits = given_limits(robust_limits([plane.image]), low, high)
    where = plane.where()
    title = where[0].upper() + where[1:]
    return plane_png(plane, limits, chosen, title=title, unit="value", note=volume.title[:80])

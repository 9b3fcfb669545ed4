"""The picture of one slice of a volume file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bentray_kernels.errors import InvalidInput

from ..volume_file import read_volume
from .canvas import drawing, new_figure, to_png
from .maps import draw_bar, draw_map, robust_limits
from .slice import COLORMAPS, given_limits


def volume_slice_png(
    path: Path,
    *,
    index: int | None = None,
    low: float | None = None,
    high: float | None = None,
    colormap: str = "viridis",
) -> bytes:
    """One slice of an uploaded volume, across its z axis.

    Args:
        path: of a file as ``volume_file.write_volume`` writes it.
        index: along z; None: the middle one.
        low, high: values of the first and the last colour; None: from the slice, but for a few outliers.
        colormap: one of ``COLORMAPS``.

    Raises:
        InvalidInput: naming the argument, or the field of the file.
    """
    if colormap not in COLORMAPS:
        raise InvalidInput("colormap", repr(colormap), "one of " + ", ".join(COLORMAPS))
    volume = read_volume(path)
    slices = volume.values.shape[2]
    k = slices // 2 if index is None else index
    if not 0 <= k < slices:
        raise InvalidInput("index", k, f"0 to {slices - 1}")
    image = volume.values[:, :, k].astype(np.float64)
    limits = given_limits(robust_limits([image]), low, high)
    place = 1e3 * (volume.origin_m[2] + k * volume.spacing_m[2])
    with drawing():
        figure = new_figure(6.6, 5.9)
        axes = figure.subplots()
        title = f"Slice index {k} (0 to {slices - 1}), z = {place:.4g} mm"
        shown = draw_map(
            axes, image, volume.spacing_m[:2], volume.origin_m[:2], limits, colormap=colormap, title=title
        )
        draw_bar([shown], "value")
        figure.supxlabel(volume.title[:80], fontsize=8, color="#666666")
        return to_png(figure)

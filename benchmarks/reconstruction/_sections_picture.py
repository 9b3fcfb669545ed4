"""Pictures of speeds on one scale."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bentray_workers.images.canvas import drawing, new_figure
from bentray_workers.images.maps import SPEED, draw_bar, draw_map, robust_limits

from ..shared._pictures import figure_png


@dataclass(frozen=True)
class Panel:
    """An image, (nx, ny), m/s, its title, and its side, m; None: that of the others."""

    title: str
    image: np.ndarray
    side_m: float | None = None


def picture(title: str, panels: Sequence[Panel], columns: int, side_m: float) -> bytes:
    """PNG of all panels, in rows; colours span the range of the first panel; side_m is the usual side."""
    rows = -(-len(panels) // columns)
    limits = robust_limits([panels[0].image])
    with drawing():
        figure = new_figure(1.9 * columns + 0.9, 2.3 * rows + 0.5)
        figure.suptitle(title)
        grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        maps = []
        for axes, panel in zip(grid.flat, panels, strict=False):
            side = panel.side_m or side_m
            spacing = (side / (len(panel.image) - 1),) * 2
            origin = (-side / 2,) * 2
            maps.append(draw_map(axes, panel.image, spacing, origin, limits, colormap=SPEED, title=""))
            axes.set_title(panel.title, fontsize=8)
            axes.label_outer()
        for axes in list(grid.flat)[len(panels) :]:
            axes.set_visible(False)
        draw_bar(maps, "sound speed (m/s)")
        return figure_png(figure)

"""Pictures of speeds on one scale: a sheet of images, and sections of volumes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bentray_kernels.acquisition import Truth
from bentray_kernels.tomography import Reconstruction
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


def picture_of_sections(truth: Truth, results: Mapping[str, Reconstruction]) -> bytes:
    """PNG: a column for the truth and each reconstruction, a row for each of three sections."""
    volumes = {"truth": truth.sound_speed_mps, **{name: result.speed for name, result in results.items()}}
    middle = [n // 2 for n in truth.sound_speed_mps.shape]
    spacing, origin = truth.spacing_m, truth.origin_m
    limits = robust_limits([truth.sound_speed_mps])
    axes_of = ((0, 1, "xy"), (0, 2, "xz"), (1, 2, "yz"))
    with drawing():
        figure = new_figure(2.4 * len(volumes) + 1.0, 5.6)
        figure.suptitle("3-D breast phantom (Li 2008, Table 7): sections through the middle")
        heights = [truth.sound_speed_mps.shape[b] * spacing[b] for _, b, _ in axes_of]
        panels = figure.subplots(3, len(volumes), squeeze=False, height_ratios=heights)
        for column, (name, volume) in enumerate(volumes.items()):
            maps = []
            for row, (a, b, plane) in enumerate(axes_of):
                third = 3 - a - b
                image = np.take(volume, middle[third], axis=third)
                axes = panels[row, column]
                title = name if row == 0 else ""
                grid = ((spacing[a], spacing[b]), (origin[a], origin[b]))
                maps.append(draw_map(axes, image, *grid, limits, colormap=SPEED, title=title))
                axes.set_xlabel(f"{plane[0]} (mm)" if column == 0 else "")
                axes.set_ylabel(f"{plane[1]} (mm)" if column == 0 else "")
        draw_bar(maps, "speed (m/s)")
        return figure_png(figure)

"""Images and quantities of results drawn on axes of Matplotlib, which the user may change further."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from matplotlib.axes import Axes

from bentray_workers.images.canvas import drawing, new_figure, to_png
from bentray_workers.images.maps import Limits, draw_bar, draw_map
from bentray_workers.images.plane import Plane

# Of one image, inches.
SIZE_IN = (6.4, 5.2)


def new_axes(count: int = 1) -> list[Axes]:
    """Axes side by side in a new figure of ``pyplot``, which notebooks and ``pyplot.show()`` show."""
    from matplotlib import pyplot as plt

    size = (SIZE_IN[0] * count, SIZE_IN[1])
    _, axes = plt.subplots(1, count, figsize=size, squeeze=False, layout="constrained")
    return list(axes[0])


def draw_plane(axes: Axes, plane: Plane, limits: Limits, *, colormap: str, title: str, label: str) -> None:
    """A slice of an image or a volume in mm, with a colour bar.

    Args:
        axes: to draw on.
        plane: the slice.
        limits: values of the first and the last colour.
        colormap: of Matplotlib.
        title: above the image; the place of the slice follows.
        label: of the colour bar.
    """
    words = ", ".join(part for part in (title, plane.caption()) if part)
    place = plane.spacing_m, plane.origin_m
    shown = draw_map(axes, plane.image, *place, limits, colormap=colormap, title=words, up=plane.names[1])
    axes.set_xlabel(f"{plane.names[0]} (mm)")
    draw_bar([shown], label)


def figure_png(width: float, height: float, count: int, draw: Callable[[Sequence[Axes]], None]) -> bytes:
    """Axes side by side in a figure of inches, drawn by ``draw``, as PNG."""
    with drawing():
        figure = new_figure(width, height)
        draw(figure.subplots(1, count, squeeze=False)[0])
        return to_png(figure)

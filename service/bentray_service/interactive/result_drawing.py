"""A quantity of a result drawn on axes, and several side by side as the picture of a notebook."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from matplotlib.axes import Axes
from numpy.typing import NDArray

from bentray_workers.images.canvas import drawing, new_figure, to_png
from bentray_workers.images.captions import LABELS, NAMES
from bentray_workers.images.maps import SPEED
from bentray_workers.images.plane import plane_of
from bentray_workers.images.report import COLORMAPS
from bentray_workers.images.slice import requested_limits, usual_limits

from .plotting import draw_plane

# Of one image in the picture of a notebook, inches.
WIDTH_IN, HEIGHT_IN = 4.6, 3.7


def draw_quantity(
    axes: Axes,
    name: str,
    images: tuple[NDArray[Any], NDArray[Any] | None],
    grid: tuple[tuple[float, ...], tuple[float, ...]],
    cut: tuple[str, int | None],
    limits: tuple[float | None, float | None],
    *,
    unit: str,
    title: str,
) -> None:
    """A slice in mm with a colour bar.

    Args:
        axes: to draw on.
        name: of the quantity, for words and colours.
        images: its array (nx, ny[, nz]), and that of the coverage, whose nodes without rays do not count for
            the limits; None: all count.
        grid: spacing and position of node 0, m.
        cut: the axis across the slice, and the index along it; None: the middle.
        limits: values of the first and the last colour; None: without outliers.
        unit: of the array.
        title: above a quantity without a name of its own.

    Raises:
        InvalidInput: naming the axis, the index or the limit.
    """
    plane, crossed = plane_of(images[0], *grid, *cut), images[1]
    coverage = None if crossed is None else plane_of(crossed, *grid, *cut).image
    chosen = requested_limits(usual_limits(name, plane.image, coverage), *limits)
    label = LABELS.get(name) or f"value ({unit})".replace(" ()", "")
    words = NAMES.get(name) or title
    draw_plane(axes, plane, chosen, colormap=COLORMAPS.get(name, SPEED), title=words, label=label)


def pictures_png(names: Sequence[str], draw: Callable[[Axes, str], None]) -> bytes:
    """Images side by side as PNG; ``draw`` draws one of them."""
    with drawing():
        figure = new_figure(WIDTH_IN * len(names), HEIGHT_IN)
        for axes, name in zip(figure.subplots(1, len(names), squeeze=False)[0], names, strict=True):
            draw(axes, name)
        return to_png(figure)

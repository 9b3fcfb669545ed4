"""Comparison of two images with their names and unit, and the drawing of slices on axes of Matplotlib."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib.axes import Axes

from bentray_kernels.tomography import comparison
from bentray_workers.images.canvas import drawing, new_figure, to_png
from bentray_workers.images.maps import Limits, draw_bar, draw_map
from bentray_workers.images.plane import Plane

from ..html_tables import figures_html, picture_html

# Of one image, inches.
SIZE_IN = (6.4, 5.2)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Comparison(comparison.Comparison):
    """Two images on one grid, and how they differ inside a region.

    Attributes:
        names: of the two images.
        quantity: as ``speed``.
        unit: of the values, such as m/s.
    """

    names: tuple[str, str]
    quantity: str
    unit: str

    def plot(self, *, axis: str = "z", index: int | None = None) -> list[Axes]:
        """Draw both images with the same colours, and their difference.

        Args:
            axis: across the slice of a volume: x, y or z.
            index: of the slice along it; None: the middle.

        Returns:
            The three axes, in a new figure of ``pyplot``.

        Raises:
            InvalidInput: naming ``axis`` or ``index``.
        """
        axes = new_axes(3)
        self._draw(axes, axis, index)
        return axes

    def _draw(self, axes: Sequence[Any], axis: str, index: int | None) -> None:
        from bentray_workers.images.maps import DIFFERENCE, SPEED, robust_limits, symmetric_limits
        from bentray_workers.images.plane import plane_of

        planes = [
            plane_of(image, self.spacing_m, self.origin_m, axis, index)
            for image in (self.image, self.other, self.difference)
        ]
        limits = robust_limits([self.image[self.region], self.other[self.region]])
        label = f"{self.quantity} ({self.unit})"
        for panel, plane, name in zip(axes[:2], planes[:2], self.names, strict=True):
            draw_plane(panel, plane, limits, colormap=SPEED, title=name.capitalize(), label=label)
        spread = symmetric_limits([self.difference[self.region]])
        title, label = f"Difference: {self.rms:.3g} {self.unit} rms", f"difference ({self.unit})"
        draw_plane(axes[2], planes[2], spread, colormap=DIFFERENCE, title=title, label=label)

    def __repr__(self) -> str:
        first, second = self.names
        return (
            f"<bentray.Comparison of {self.quantity}, {first} minus {second}: rms {self.rms:.4g}, "
            f"mean absolute {self.mean_absolute:.4g}, bias {self.bias:.4g} {self.unit}>"
        )

    def to_png(self) -> bytes:
        """Both images and their difference as a PNG file; of a volume the middle slice."""
        return figure_png(13.0, 3.9, 3, lambda axes: self._draw(axes, "z", None))

    def _repr_html_(self) -> str:
        rows = [
            ("root mean square", f"{self.rms:.4g} {self.unit}"),
            ("mean absolute", f"{self.mean_absolute:.4g} {self.unit}"),
            ("bias", f"{self.bias:.4g} {self.unit}"),
            ("largest", f"{self.largest:.4g} {self.unit}"),
            ("correlation", f"{self.correlation:.4f}"),
            ("SSIM", f"{self.ssim:.4f}"),
            ("region", f"{self.region_choice}, {int(self.region.sum())} nodes"),
        ]
        first, second = self.names
        return picture_html(self.to_png(), "comparison") + figures_html(f"{first} minus {second}", rows)


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

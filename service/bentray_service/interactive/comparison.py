"""Comparison of two images on the nodes of the first: difference, errors and picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import (
    RegionStatistics,
    RoundRegion,
    correlation,
    region_statistics,
    structural_similarity,
)

from ..html_tables import figures_html, picture_html
from .plotting import draw_plane, new_axes

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """Two images on one grid, and how they differ inside a region.

    Attributes:
        names: of the two images.
        quantity: as ``speed``.
        unit: of the values, such as m/s.
        image: (nx, ny[, nz]), the first image.
        other: the second one at the same nodes; NaN where it has no values.
        region: nodes that the figures are of, at least one.
        region_choice: description of the region.
        spacing_m, origin_m: of the nodes per axis (x, y[, z]), m.
        uncertainty: standard deviation of the first image at each node, or None.
    """

    names: tuple[str, str]
    quantity: str
    unit: str
    image: Floats
    other: Floats
    region: Bools
    region_choice: str
    spacing_m: tuple[float, ...]
    origin_m: tuple[float, ...]
    uncertainty: Floats | None = None

    @property
    def difference(self) -> Floats:
        """The first image minus the second one."""
        return self.image - self.other

    @property
    def rms(self) -> float:
        """Root mean square of the difference in the region."""
        return float(np.sqrt(np.mean(self.difference[self.region] ** 2)))

    @property
    def mean_absolute(self) -> float:
        """Mean of the absolute difference in the region."""
        return float(np.mean(np.abs(self.difference[self.region])))

    @property
    def largest(self) -> float:
        """Largest absolute difference in the region."""
        return float(np.max(np.abs(self.difference[self.region])))

    @property
    def bias(self) -> float:
        """Mean of the difference in the region."""
        return float(np.mean(self.difference[self.region]))

    @property
    def correlation(self) -> float:
        """Pearson's correlation of the two images in the region; NaN if one of them is constant."""
        return correlation(self.image, self.other, self.region)

    @property
    def ssim(self) -> float:
        """Structural similarity in the region, for the range of the second image; see ``bentray compare``.

        NaN if the region holds no window of 7 × 7 nodes, or the second image is constant.
        """
        spread = float(np.nanmax(self.other) - np.nanmin(self.other))
        return (
            structural_similarity(self.image, self.other, self.region, spread) if spread > 0.0 else math.nan
        )

    def statistics(
        self, centre_m: Sequence[float] | None = None, radius_m: float | None = None
    ) -> tuple[RegionStatistics, RegionStatistics]:
        """Mean, spread, size and contrast of both images in a disc or ball, or in the whole region.

        Args:
            centre_m: (x, y[, z]), m; None: the region of the comparison, which has no surroundings.
            radius_m: of the disc or ball, m.

        Returns:
            Of the first and of the second image. The contrast is that to a ring from 1.25 to 2 radii.

        Raises:
            InvalidInput: naming the argument, also for a disc without a node.
        """
        nodes = round_nodes(centre_m, radius_m, self.image.shape, self.spacing_m, self.origin_m)
        inside, beside = (self.region, None) if nodes is None else nodes
        deviations = (self.uncertainty, None)
        first, second = (
            region_statistics(one, inside, self.spacing_m, beside, deviation)
            for one, deviation in zip((self.image, self.other), deviations, strict=True)
        )
        return first, second

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
        for place, plane, name in zip(axes[:2], planes[:2], self.names, strict=True):
            draw_plane(place, plane, limits, colormap=SPEED, title=name.capitalize(), label=label)
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
        from bentray_workers.images.canvas import drawing, new_figure, to_png

        with drawing():
            figure = new_figure(13.0, 3.9)
            self._draw(figure.subplots(1, 3), "z", None)
            return to_png(figure)

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


def round_nodes(
    centre_m: Sequence[float] | None,
    radius_m: float | None,
    shape: tuple[int, ...],
    spacing_m: Sequence[float],
    origin_m: Sequence[float],
) -> tuple[Bools, Bools] | None:
    """Nodes of a disc or ball and of its surroundings; None without one.

    Raises:
        InvalidInput: naming ``centre_m`` or ``radius_m``, also if only one of them is given.
    """
    if centre_m is None and radius_m is None:
        return None
    if centre_m is None or radius_m is None:
        missing = "centre_m" if centre_m is None else "radius_m"
        raise InvalidInput(missing, "none", "both centre_m and radius_m, or neither")
    region = RoundRegion(tuple(float(one) for one in centre_m), float(radius_m))
    return region.nodes(shape, spacing_m, origin_m)


def at_nodes(
    values: NDArray[Any],
    grid: tuple[Sequence[float], Sequence[float]],
    shape: tuple[int, ...],
    nodes: tuple[Sequence[float], Sequence[float]],
) -> Floats:
    """Linear interpolation of an image at the nodes of another one.

    Args:
        values: (nx, ny[, nz]).
        grid: its spacing and origin per axis, m.
        shape: of the nodes.
        nodes: their spacing and origin, m.

    Returns:
        An array of ``shape``; NaN outside the image.
    """
    if values.shape == shape and np.array_equal(grid, nodes, equal_nan=True):
        return np.asarray(values, dtype=np.float64)
    from scipy.interpolate import RegularGridInterpolator

    lines = [o + h * np.arange(n) for h, o, n in zip(*grid, values.shape, strict=True)]
    read = RegularGridInterpolator(lines, values.astype(np.float64), bounds_error=False, fill_value=np.nan)
    found = np.empty(shape)
    places = [o + h * np.arange(n) for h, o, n in zip(*nodes, shape, strict=True)]
    # Layer by layer, so that the coordinates of all nodes are never in memory at once.
    for k, first in enumerate(places[0]):
        mesh = np.meshgrid(np.array([first]), *places[1:], indexing="ij")
        found[k] = read(np.stack(mesh, axis=-1))[0]
    return found

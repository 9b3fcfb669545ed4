"""Comparison of two images on one grid: errors, similarity and statistics in a region."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import RegularGridInterpolator
from scipy.ndimage import binary_erosion, binary_fill_holes, uniform_filter

from ..acquisition import Truth
from ..arrays import Flags, Floats, refuse_mask
from ..errors import InvalidInput
from .regions import RegionStatistics, region_statistics, round_nodes
from .result import Reconstruction

# True speeds within this of that of water are water, m/s.
WATER_TOLERANCE_MPS = 1.0

# Nodes along a side of the windows of the structural similarity, and its constants (Wang et al., 2004).
WINDOW, K1, K2 = 7, 0.01, 0.03


class NotComparable(Exception):  # noqa: N818 - a property of the truth, not an error of the input
    """The truth cannot be interpolated on the image; the text is the reason to display."""


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """Two images on one grid, and how they differ inside a region.

    Attributes:
        image: (nx, ny[, nz]), the first image.
        other: the second one at the same nodes, such as the truth; NaN where it has no values.
        region: nodes that the figures are of, at least one.
        region_choice: description of the region.
        spacing_m, origin_m: of the nodes per axis (x, y[, z]), m.
        uncertainty: standard deviation of the first image at each node, or None.
    """

    image: Floats
    other: Floats
    region: Flags
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
        return rmse(self.image, self.other, self.region)

    @property
    def mean_absolute(self) -> float:
        """Mean of the absolute difference in the region."""
        return mean_absolute_error(self.image, self.other, self.region)

    @property
    def mean_absolute_of_range(self) -> float | None:
        """Mean absolute difference relative to ``range`` (chapter 6.4); None if the range is 0."""
        low, high = self.range
        return mean_absolute_error(self.image, self.other, self.region, high - low) if high > low else None

    @property
    def largest(self) -> float:
        """Largest absolute difference in the region."""
        return float(np.max(np.abs(self.difference[self.region])))

    @property
    def bias(self) -> float:
        """Mean of the difference in the region."""
        return float(np.mean(self.difference[self.region]))

    @property
    def range(self) -> tuple[float, float]:
        """Lowest and highest value of the second image in the region."""
        values = self.other[self.region]
        return float(values.min()), float(values.max())

    @property
    def correlation(self) -> float:
        """Pearson's correlation of the two images in the region; NaN if one of them is constant."""
        return correlation(self.image, self.other, self.region)

    @property
    def ssim(self) -> float:
        """Structural similarity in the region, for the range of the second image over all its nodes.

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
        inside, around = (self.region, None) if nodes is None else nodes
        first = region_statistics(self.image, inside, self.spacing_m, around, self.uncertainty)
        return first, region_statistics(self.other, inside, self.spacing_m, around)

    def caption(self) -> str:
        """The errors of a speed, relative to its range and in m/s."""
        rms, relative = f"{self.rms:.1f} m/s rms", self.mean_absolute_of_range
        return rms if relative is None else f"{100.0 * relative:.1f} % of range, {rms}"


def compare(result: Reconstruction, truth: Truth, roi: Flags | None = None) -> Comparison:
    """Compare the speed of a result with the truth at the nodes of the image, without registration.

    The region is ``roi`` if it is on the grid of the truth and not empty; otherwise the object, where the
    truth is not water, with everything inside; otherwise all nodes covered by the truth.

    Args:
        result: the image, over all its slices.
        truth: of the scan.
        roi: region on the grid of the truth.

    Raises:
        NotComparable: if the truth cannot be interpolated on the image, or does not overlap it.
    """
    true_speed = on_grid(truth.sound_speed_mps, truth, result)
    covered = np.isfinite(true_speed)
    if not covered.any():
        raise NotComparable("no node of the image lies within the truth")
    choice, region = "every node that the truth covers", covered
    marked = np.zeros_like(covered)
    if roi is not None and roi.shape == truth.sound_speed_mps.shape:
        marked = (on_grid(roi, truth, result) > 0.5) & covered
    outline = _outline(true_speed, covered, result.water_speed_mps)
    if marked.any():
        choice, region = "mask/roi of the file", marked
    elif outline.any():
        choice, region = "the outline of what is not water in the truth", outline
    grid = result.spacing_m, result.origin_m
    return Comparison(result.speed, true_speed, region, choice, *grid, result.uncertainty)


def _outline(true_speed: Floats, covered: Flags, water_speed_mps: float) -> Flags:
    """The object, where the speed is not that of water, with enclosed nodes, slice by slice."""
    off = np.abs(np.where(covered, true_speed, water_speed_mps) - water_speed_mps)
    other = np.atleast_3d(off > WATER_TOLERANCE_MPS)
    filled = [binary_fill_holes(other[..., k]) for k in range(other.shape[2])]
    return np.asarray(np.stack(filled, axis=-1).reshape(true_speed.shape) & covered)


def on_grid(values: ArrayLike, truth: Truth, result: Reconstruction) -> Floats:
    """Linear interpolation of values on the grid of the truth at the nodes of the image.

    Args:
        values: of the shape of ``truth.sound_speed_mps``.
        truth: with the grid of the values.
        result: with the grid of the image.

    Returns:
        An array of the shape of ``result.speed``; NaN outside the truth.

    Raises:
        NotComparable: for axes that do not match.
    """
    order = truth.order
    if order is None:
        raise NotComparable("the truth must be registered with the image first")
    if not len(order) == truth.sound_speed_mps.ndim == result.speed.ndim:
        raise NotComparable(
            f"the truth has axes {truth.axes} and {truth.sound_speed_mps.ndim} dimensions, "
            f"the image {result.speed.ndim}"
        )
    if not np.isfinite(result.spacing_m).all():
        raise NotComparable("the slices of the image are not evenly spaced")
    # Spacing and origin are listed in the order of the axes, too.
    grid = [truth.spacing_m[a] for a in order], [truth.origin_m[a] for a in order]
    image = np.asarray(values, np.float64).transpose(order)
    return at_nodes(image, grid, result.speed.shape, (result.spacing_m, result.origin_m))


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
    lines = [o + h * np.arange(n) for h, o, n in zip(*grid, values.shape, strict=True)]
    read = RegularGridInterpolator(lines, values.astype(np.float64), bounds_error=False, fill_value=np.nan)
    first, *others = (o + h * np.arange(n) for h, o, n in zip(*nodes, shape, strict=True))
    interpolated = np.empty(shape)
    # Layer by layer, so that the coordinates of all nodes are never in memory at once.
    for k, x in enumerate(first):
        mesh = np.meshgrid(np.array([x]), *others, indexing="ij")
        interpolated[k] = read(np.stack(mesh, axis=-1))[0]
    return interpolated


def mean_absolute_error(
    image: ArrayLike, truth: ArrayLike, region: ArrayLike, value_range: float = 1.0
) -> float:
    """Mean of |image − truth| over a region, as a part of the phantom's range (chapter 6.4).

    Args:
        image, truth: one shape, one unit.
        region: booleans of that shape: where to look.
        value_range: highest minus lowest value of the phantom, in the same unit; 1: the error in this unit.

    Raises:
        InvalidInput: for shapes that differ, an empty region or a range that is not positive.
    """
    _check_range(value_range)
    a, b, where = _checked(image, truth, region)
    return float(np.abs(a[where] - b[where]).mean() / value_range)


def rmse(image: ArrayLike, truth: ArrayLike, region: ArrayLike) -> float:
    """Root mean square of image − truth over a region, in the images' unit; see ``mean_absolute_error``."""
    a, b, where = _checked(image, truth, region)
    return float(np.sqrt(((a[where] - b[where]) ** 2).mean()))


def correlation(image: ArrayLike, truth: ArrayLike, region: ArrayLike) -> float:
    """Pearson's correlation coefficient (PCC) of two images over a region; NaN if one is constant there."""
    a, b, where = _checked(image, truth, region)
    first, second = (image[where] - image[where].mean() for image in (a, b))
    norm = math.sqrt(float(first @ first) * float(second @ second))
    return float(first @ second) / norm if norm > 0.0 else math.nan


def structural_similarity(image: ArrayLike, truth: ArrayLike, region: ArrayLike, value_range: float) -> float:
    """Structural similarity (SSIM), the mean over all windows of 7 × 7 nodes that lie in a region.

    Uniform windows and sample covariances, as the defaults of scikit-image; of a volume windows in its slices
    (z = constant).

    Args:
        image, truth: (nx, ny[, nz]), one unit; anything outside the region.
        region: booleans of that shape.
        value_range: of the truth, highest minus lowest value.

    Returns:
        At most 1, for equal images; NaN if the region holds no window.

    Raises:
        InvalidInput: as ``mean_absolute_error``.

    Source: Wang, Bovik, Sheikh, Simoncelli, IEEE Trans. Image Process. 13(4), 2004, equation 13.
    """
    _check_range(value_range)
    a, b, where = _checked(image, truth, region)
    window = (WINDOW, WINDOW) + (1,) * (where.ndim - 2)
    centres = binary_erosion(where, np.ones(window, np.bool_))
    if not centres.any():
        return math.nan
    # Differences from one value: squares of speeds would lose digits. Nodes outside are in no window.
    offset = float(b[where].mean())
    x, y = (np.where(where, image - offset, 0.0) for image in (a, b))
    mean_x, mean_y = (uniform_filter(image, window) for image in (x, y))
    sample = WINDOW**2 / (WINDOW**2 - 1.0)
    variance_x = sample * (uniform_filter(x * x, window) - mean_x * mean_x)
    variance_y = sample * (uniform_filter(y * y, window) - mean_y * mean_y)
    covariance = sample * (uniform_filter(x * y, window) - mean_x * mean_y)
    mean_x, mean_y = mean_x + offset, mean_y + offset
    c1, c2 = (K1 * value_range) ** 2, (K2 * value_range) ** 2
    similarity = (2.0 * mean_x * mean_y + c1) * (2.0 * covariance + c2)
    similarity /= (mean_x**2 + mean_y**2 + c1) * (variance_x + variance_y + c2)
    return float(similarity[centres].mean())


def _check_range(value_range: float) -> None:
    if not value_range > 0.0:
        raise InvalidInput("value_range", value_range, "a range > 0")


def _checked(
    image: ArrayLike, truth: ArrayLike, region: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    for name, array in (("image", image), ("truth", truth), ("region", region)):
        refuse_mask(name, array)
    a, b, where = np.asarray(image, np.float64), np.asarray(truth, np.float64), np.asarray(region, np.bool_)
    if a.shape != b.shape or where.shape != a.shape:
        raise InvalidInput(
            "region", f"shapes {a.shape}, {b.shape}, {where.shape}", "image, truth and region of one shape"
        )
    if not where.any():
        raise InvalidInput("region", "no node", "at least one node")
    return a, b, where

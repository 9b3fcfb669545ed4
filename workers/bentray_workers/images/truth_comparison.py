"""Comparison of a reconstruction with the truth: region, true speed, errors and statistics."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_fill_holes

from bentray_kernels.acquisition import Truth
from bentray_kernels.tomography import (
    Reconstruction,
    RegionStatistics,
    correlation,
    mean_absolute_error,
    region_statistics,
    rmse,
    structural_similarity,
)

from .truth_on_grid import NotComparable, on_grid

__all__ = ["Comparison", "NotComparable", "compare"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# True speeds within this of that of water are water, m/s.
WATER_TOLERANCE_MPS = 1.0


@dataclass(frozen=True)
class Comparison:
    """Errors of an image against the truth, over all slices.

    Attributes:
        true_speed_mps: at the nodes of the image; NaN outside the truth.
        region: nodes for the errors, at least one.
        region_choice: description of the region.
        true_range_mps: lowest and highest true speed in the region.
        mean_absolute_error_of_range: relative to that range (chapter 6.4); None if the range is 0.
        rmse_mps: root mean square error.
        mean_absolute_error_mps: mean absolute error.
        ssim: structural similarity, with the range of the truth over all nodes that it covers; NaN if the
            region is smaller than a window or the truth is constant.
        correlation: Pearson's correlation; NaN if the truth or the image is constant.
        image_statistics, true_statistics: of the region, m/s.
    """

    true_speed_mps: Floats
    region: Bools
    region_choice: str
    true_range_mps: tuple[float, float]
    mean_absolute_error_of_range: float | None
    rmse_mps: float
    mean_absolute_error_mps: float
    ssim: float
    correlation: float
    image_statistics: RegionStatistics
    true_statistics: RegionStatistics

    def __str__(self) -> str:
        """The errors as a caption."""
        rms = f"{self.rmse_mps:.1f} m/s rms"
        if self.mean_absolute_error_of_range is None:
            return rms
        return f"{100.0 * self.mean_absolute_error_of_range:.1f} % of range, {rms}"


def compare(result: Reconstruction, truth: Truth, roi: Bools | None = None) -> Comparison:
    """Compute errors at the nodes of the image, without registration.

    The region is ``roi`` if it is on the grid of the truth and not empty; otherwise the object, where the
    truth is not water, with everything inside; otherwise all nodes covered by the truth.

    Args:
        result: the image.
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
    marked = _marked(roi, truth, result) & covered
    outline = _outline(true_speed, covered, result.water_speed_mps)
    if marked.any():
        choice, region = "mask/roi of the file", marked
    elif outline.any():
        choice, region = "the outline of what is not water in the truth", outline
    low, high = float(true_speed[region].min()), float(true_speed[region].max())
    whole = float(np.ptp(true_speed[covered]))
    return Comparison(
        true_speed_mps=true_speed,
        region=region,
        region_choice=choice,
        true_range_mps=(low, high),
        mean_absolute_error_of_range=(
            mean_absolute_error(result.speed, true_speed, region, high - low) if high > low else None
        ),
        rmse_mps=rmse(result.speed, true_speed, region),
        mean_absolute_error_mps=mean_absolute_error(result.speed, true_speed, region),
        ssim=structural_similarity(result.speed, true_speed, region, whole) if whole > 0.0 else math.nan,
        correlation=correlation(result.speed, true_speed, region),
        image_statistics=region_statistics(
            result.speed, region, result.spacing_m, uncertainty=result.uncertainty
        ),
        true_statistics=region_statistics(true_speed, region, result.spacing_m),
    )


def _marked(roi: Bools | None, truth: Truth, result: Reconstruction) -> Bools:
    if roi is None or roi.shape != truth.sound_speed_mps.shape:
        return np.zeros(result.speed.shape, np.bool_)
    return np.asarray(on_grid(roi, truth, result) > 0.5)


def _outline(true_speed: Floats, covered: Bools, water_speed_mps: float) -> Bools:
    """The object, where the speed is not that of water, with enclosed nodes, slice by slice."""
    off = np.abs(np.where(covered, true_speed, water_speed_mps) - water_speed_mps)
    other = np.atleast_3d(off > WATER_TOLERANCE_MPS)
    filled = [binary_fill_holes(other[..., k]) for k in range(other.shape[2])]
    return np.asarray(np.stack(filled, axis=-1).reshape(true_speed.shape) & covered)

"""Error of reconstructed images of one quantity against the truth, in one region and norm."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.acquisition import Dataset
from bentray_kernels.tomography import Reconstruction, mean_absolute_error, rmse
from bentray_kernels.tomography.comparison import compare, on_grid

Quantity = Literal["speed", "attenuation"]
Norm = Literal["rms", "mean absolute"]


@dataclass(frozen=True)
class ImageError:
    """The truth on the grid of an image, and how images are compared with it.

    Attributes:
        true: true values at the nodes; anything outside the region.
        region: nodes that count.
        unit: in which errors are given, in the unit of the quantity, e.g. its range.
        norm: root mean square, or mean absolute.
        quantity: that is compared.
    """

    true: NDArray[np.float64]
    region: NDArray[np.bool_]
    unit: float = 1.0
    norm: Norm = "rms"
    quantity: Quantity = "speed"

    def of(self, image: Reconstruction) -> float:
        """Error of an image on this grid; NaN if it does not have the quantity."""
        values = getattr(image, self.quantity)
        return float("nan") if values is None else self._of_values(values)

    def of_constant(self, value: float) -> float:
        """Error of an image of one value."""
        return self._of_values(np.full_like(self.true, value))

    @property
    def best_constant(self) -> float:
        """The value with the least error: the mean of the truth for rms, else its median."""
        true = self.true[self.region]
        return float(true.mean() if self.norm == "rms" else np.median(true))

    def _of_values(self, values: NDArray[np.float64]) -> float:
        if self.norm == "mean absolute":
            return mean_absolute_error(values, self.true, self.region, self.unit)
        return rmse(values, self.true, self.region) / self.unit


# The error on the grid of a given image: the default settings choose their own.
ErrorOn = Callable[[Reconstruction], ImageError]


def object_error(dataset: Dataset, *, relative: bool = False) -> ErrorOn:
    """Root mean square error of the speed over the object, as ``compare`` gives it.

    Args:
        dataset: with its truth.
        relative: to the true range in the object; else m/s.
    """

    def error_on(image: Reconstruction) -> ImageError:
        assert dataset.truth is not None
        comparison = compare(image, dataset.truth, dataset.roi)
        low, high = comparison.range
        return ImageError(comparison.other, comparison.region, high - low if relative else 1.0)

    return error_on


def object_attenuation_error(dataset: Dataset) -> ErrorOn:
    """Root mean square error of the attenuation over the object, relative to its true range there."""

    def error_on(image: Reconstruction) -> ImageError:
        truth = dataset.truth
        assert truth is not None
        assert truth.attenuation_np_m is not None
        region = compare(image, truth, dataset.roi).region
        true = on_grid(truth.attenuation_np_m, truth, image)
        return ImageError(true, region, float(np.ptp(true[region])), quantity="attenuation")

    return error_on

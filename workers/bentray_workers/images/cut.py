"""Slices of a volume: index, image, and whether to show a vertical section."""

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Reconstruction

# Smallest number of slices for a vertical section.
MIN_HEIGHTS = 4

Kind = TypeVar("Kind", bound=np.generic)


def slice_index(result: Reconstruction, index: int | None = None) -> int:
    """``index``, or the middle slice for None; 0 for a 2-D image.

    Raises:
        InvalidInput: for an index beyond the slices.
    """
    slices = 1 if result.speed.ndim == 2 else result.speed.shape[2]
    if index is None:
        return slices // 2
    if not 0 <= index < slices:
        raise InvalidInput("index", index, f"0 to {slices - 1}")
    return index


def cut(volume: NDArray[Kind], index: int) -> NDArray[Kind]:
    """A slice (nx, ny) of a volume (nx, ny, nz); a 2-D image is returned unchanged."""
    return volume if volume.ndim == 2 else volume[..., index]


def has_section(result: Reconstruction) -> bool:
    """Whether there are enough evenly spaced slices for a vertical section."""
    return (
        result.speed.ndim == 3 and result.speed.shape[2] >= MIN_HEIGHTS and math.isfinite(result.spacing_m[2])
    )

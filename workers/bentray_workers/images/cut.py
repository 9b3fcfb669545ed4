"""One slice of a volume: which one, and its image."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Reconstruction

Kind = TypeVar("Kind", bound=np.generic)


def slice_index(result: Reconstruction, index: int | None = None) -> int:
    """``index``, or the middle slice for None; 0 for a plain image.

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
    """The slice (nx, ny) of a volume (nx, ny, nz); a plain image is its own slice."""
    return volume if volume.ndim == 2 else volume[..., index]

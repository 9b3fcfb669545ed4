"""The content of an exported file: images on one grid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput

from ..volume_axes import Grid


@dataclass(frozen=True)
class Content:
    """Content of the file of a volume: one grid.

    Attributes:
        values: (nx, ny[, nz]): the selected quantity of a reconstruction, or the values of an upload.
        grid: positions of the nodes.
        title: of the volume.
        images: all arrays on this grid by name, including the values.
        seconds: time of the file, s since 1970.
    """

    values: NDArray[Any]
    grid: Grid
    title: str
    images: Mapping[str, NDArray[Any]]
    seconds: float = 0.0

    @property
    def line(self) -> str:
        """The title in one line."""
        return " ".join(self.title.split())

    def check_even(self, title: str) -> None:
        """Raise InvalidInput for slices with uneven spacing (not finite), which a format cannot store."""
        spacing = self.grid.spacing_m
        if not np.isfinite(spacing).all():
            given = f"uneven slices (spacing {tuple(float(step) for step in spacing)} m)"
            raise InvalidInput("volume", given, f"even spacing for {title}; hdf5 holds any")

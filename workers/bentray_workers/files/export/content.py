"""The content of an exported file, images on one grid; and what several writers share."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput

from ..atomic import atomic_replace
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


def import_optional(library: str, extra: str, what: str) -> Any:
    """A library of an extra of the package.

    Raises:
        InvalidInput: naming the command that installs it.
    """
    try:
        return import_module(library)
    except ImportError:
        accepted = f'another format, or an installation with pip install "bentray[{extra}]"'
        raise InvalidInput("format", f"{what} without the library {library}", accepted) from None


def write_header_and_values(path: Path, header: str, values: NDArray[Any]) -> None:
    """Write the header, then little-endian values with x varying fastest; ``path`` is replaced atomically.

    Args:
        path: of the file.
        header: text up to the first value.
        values: (nx, ny[, nz]).

    Raises:
        OSError: where the folder cannot be written to or the disk is full.
    """
    with atomic_replace(path) as partial, partial.open("wb") as file:
        file.write(header.encode())
        write_values(file, values)


def write_values(file: IO[bytes], values: NDArray[Any]) -> None:
    """Write little-endian values (nx, ny[, nz]) with x varying fastest."""
    stored = np.asarray(values, dtype=values.dtype.newbyteorder("<"))
    # One slice at a time, since transposing the whole would double the memory.
    for k in range(stored.shape[-1]):
        file.write(stored[..., k].tobytes(order="F"))


def type_name(values: NDArray[Any], names: Mapping[str, str]) -> str:
    """Name of the type of the values in a format, by its NumPy code without byte order, e.g. ``f4``."""
    return names[values.dtype.str[1:]]

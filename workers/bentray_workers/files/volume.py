"""Volume files: ``bentray-volume`` in HDF5, written atomically and read exactly."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bentray_kernels.arrays import Floats
from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.limits import SPACING_M
from bentray_kernels.requests.ranges import Range

from .damage import check_real
from .hdf5_reading import Reader, opened, printable
from .hdf5_writing import atomic_hdf5
from .volume_axes import MAX_SHEAR, Grid, PositionedImage

FORMAT = "bentray-volume"
VERSION = "1.0"

# Types that are stored; others are converted to float32.
KEPT = (np.dtype(np.uint8), np.dtype(np.uint16), np.dtype(np.float32))

# Position of node 0; large values are harmless.
ORIGIN_M = Range(-1e6, 1e6, unit="m")
MAX_FLOAT32 = float(np.finfo(np.float32).max)
# Levels of its range that must be distinguishable in float32, as many as in 8 bits.
LEVELS = 256
Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Volume:
    """Values on an even grid.

    Attributes:
        values: (nx, ny, nz), uint8, uint16 or float32, finite, any unit.
        spacing_m: between nodes along each axis, within ``SPACING_M``.
        origin_m: position of node 0, m, within ``ORIGIN_M``.
        title: of the volume.
        direction: (3, 3), see ``volume_axes.Grid``; other than the identity for oblique axes.

    Raises:
        InvalidInput: naming the first field that is wrong.
    """

    values: NDArray[Any]
    spacing_m: Triple
    origin_m: Triple = (0.0, 0.0, 0.0)
    title: str = ""
    direction: Floats = field(default_factory=lambda: np.eye(3))

    def __post_init__(self) -> None:
        check_shape("values", self.values.shape)
        if not np.isfinite(self.values).all():
            node = tuple(int(k) for k in np.argwhere(~np.isfinite(self.values))[0])
            raise InvalidInput("values", f"{self.values[node]} at node {node}", "finite numbers")
        for name, given, within in (
            ("spacing_m", self.spacing_m, SPACING_M),
            ("origin_m", self.origin_m, ORIGIN_M),
        ):
            if len(given) != 3 or not all(map(within.holds, given)):
                raise InvalidInput(name, given, f"three times {within.words}")
        turned = self.direction
        # Comparisons with NaN are false.
        if turned.shape != (3, 3) or not (np.abs(turned.T @ turned - np.eye(3)) < MAX_SHEAR).all():
            raise InvalidInput("direction", turned.ravel().tolist(), "nine numbers, orthonormal columns")

    @property
    def grid(self) -> Grid:
        """Positions of the nodes."""
        return Grid(self.spacing_m, self.origin_m, self.direction)

    @classmethod
    def from_values(
        cls,
        values: ArrayLike,
        spacing_m: Sequence[float],
        origin_m: Sequence[float] = (0.0, 0.0, 0.0),
        title: str = "",
        direction: Floats | None = None,
    ) -> Volume:
        """A volume of any real type, converted to a stored type.

        Raises:
            InvalidInput: as ``Volume``, and for values that float32 cannot represent or distinguish.
        """
        array = np.asarray(values)
        check_type("values", array.dtype)
        check_shape("values", array.shape)
        native = array.dtype.newbyteorder("=")
        stored = np.ascontiguousarray(array, dtype=native) if native in KEPT else _as_float32(array)
        return cls(
            stored,
            tuple(float(step) for step in spacing_m),  # type: ignore[arg-type]
            tuple(float(coordinate) for coordinate in origin_m),  # type: ignore[arg-type]
            printable(title)[:200].strip(),
            np.eye(3) if direction is None else direction,
        )

    @classmethod
    def from_image(cls, image: PositionedImage) -> Volume:
        """A volume of an image from a foreign file; raises as ``of``."""
        grid = image.grid
        return cls.from_values(image.values, grid.spacing_m, grid.origin_m, image.title, grid.direction)

    def range(self) -> tuple[float, float]:
        """Least and greatest value."""
        return float(self.values.min()), float(self.values.max())


def _as_float32(values: NDArray[Any]) -> NDArray[np.float32]:
    """Convert to float32; raises InvalidInput if values become indistinguishable."""
    low, high = values.min().item(), values.max().item()
    biggest = max(abs(low), abs(high))
    if MAX_FLOAT32 < biggest < math.inf:
        given = low if abs(low) == biggest else high
        raise InvalidInput("values", f"{given:g}, beyond float32", f"numbers up to {MAX_FLOAT32:.2g} in size")
    # Infinite values are rejected with the volume.
    with np.errstate(over="ignore"):
        stored = np.ascontiguousarray(values, dtype=np.float32)
    if not math.isfinite(biggest) or not 0 < high - low < LEVELS * np.spacing(np.float32(biggest)):
        return stored
    # The steps of float32 are coarse here; values that are exact in float32 are accepted.
    lost = max(
        float(np.abs(np.subtract(value, theirs, dtype=np.longdouble)).max())
        for value, theirs in zip(values, stored, strict=True)
    )
    if lost > (high - low) / LEVELS:
        given = f"{low} to {high}, values that float32 cannot distinguish"
        raise InvalidInput("values", given, "numbers near 0 beside their range; subtract an offset first")
    return stored


def check_shape(field: str, shape: Sequence[int], least: int = 2) -> None:
    """Reject shapes other than (nx, ny, nz) with ``least`` or more nodes along each axis."""
    if len(shape) != 3 or min(shape) < least:
        raise InvalidInput(field, f"shape {tuple(shape)}", "(nx, ny, nz), at least two nodes along each axis")


def check_type(field: str, dtype: np.dtype[Any]) -> None:
    """Refuse what is not a real number."""
    check_real(field, dtype, "integers or floating-point numbers")
    if dtype.kind not in "buif":
        words = {"O": "Python objects", "V": "records, as RGB"}
        given = words.get(dtype.kind, "no numbers")
        raise InvalidInput(field, f"{given} ({dtype})", "integers or floating-point numbers")


def write_volume(path: Path, volume: Volume) -> None:
    """Write a volume; ``path`` is replaced atomically.

    The file holds ``values``, uncompressed, since every picture reads all of them, and the root attributes
    ``format``, ``format_version``, ``spacing_m``, ``origin_m``, ``direction`` (by rows) and ``title``.

    Raises:
        OSError: where the folder cannot be written to or the disk is full.
    """
    with atomic_hdf5(Path(path), FORMAT, VERSION) as file:
        file.attrs["spacing_m"] = volume.spacing_m
        file.attrs["origin_m"] = volume.origin_m
        file.attrs["direction"] = volume.direction.ravel()
        file.attrs["title"] = volume.title
        file.create_dataset("values", data=volume.values, track_times=False)


def volume_in(reader: Reader) -> Volume:
    """The volume in an open file of this format; raises InvalidInput as ``read_volume``."""
    reader.check_format(FORMAT, VERSION)
    values = reader.required("values", "buif", "(nx, ny, nz) numbers")
    spacing, origin = (reader.numbers("", name, "m") or () for name in ("spacing_m", "origin_m"))
    # Files of earlier versions have none.
    turned = np.array(reader.numbers("", "direction", "no unit") or np.eye(3).ravel())
    direction = turned.reshape(3, 3) if turned.size == 9 else turned
    return Volume.from_values(values, spacing, origin, reader.text("", "title") or "", direction)


def read_volume(path: Path) -> Volume:
    """Read a volume.

    Raises:
        InvalidInput: naming the first field that is missing or wrong, as ``read_dataset`` does.
    """
    with opened(Path(path)) as reader:
        return volume_in(reader)

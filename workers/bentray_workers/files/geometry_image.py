"""Geometry images as files: ``bentray-geometry-image`` in HDF5, and PNG of positions, normals and colours."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from bentray_kernels.arrays import Flags, Floats
from bentray_kernels.errors import InvalidInput
from bentray_kernels.geometry_field.image.geometry_image import GeometryImage

from .hdf5_reading import Reader, opened
from .hdf5_writing import atomic_hdf5

FORMAT = "bentray-geometry-image"
VERSION = "1.0"

Pixels = NDArray[np.float32]


@dataclass(frozen=True)
class GeometryMaps:
    """Arrays of a geometry image; pixel (i, j) of n² lies at (u, v) = (i, j)/(n − 1).

    Attributes:
        positions: (n, n, 3) in the unit cube.
        normals: (n, n, 3) unit vectors.
        valid: (n, n) whether a pixel represents a point of the surface; the others are 0.
        colours: (n, n, 3) in [0, 1], or None.
    """

    positions: Pixels
    normals: Pixels
    valid: Flags
    colours: Pixels | None = None

    @classmethod
    def from_geometry_image(cls, image: GeometryImage, colours: Floats | None = None) -> GeometryMaps:
        """Arrays of an image, with the colours of its mesh, (vertices, 3), if any."""
        return cls(
            image.positions.astype(np.float32),
            image.normals.astype(np.float32),
            image.valid,
            None if colours is None else image.sampled(colours).astype(np.float32),
        )


def write_geometry_image(path: Path, maps: GeometryMaps) -> None:
    """Write the arrays, float32 and bytes; ``path`` is replaced atomically.

    Raises:
        OSError: where the folder cannot be written to or the disk is full.
    """
    with atomic_hdf5(path) as file:
        file.attrs["format"] = FORMAT
        file.attrs["format_version"] = VERSION
        for name, values in _named(maps).items():
            file.create_dataset(name, data=values, compression="gzip", shuffle=True, track_times=False)


def read_geometry_image(path: Path) -> GeometryMaps:
    """Read what ``write_geometry_image`` wrote.

    Raises:
        InvalidInput: naming the first field that is missing or wrong.
    """
    with opened(path) as reader:
        reader.check_format(FORMAT, VERSION)
        positions = _map(reader, "positions")
        normals = _map(reader, "normals")
        valid = reader.required("valid", "u", "(n, n) bytes, 0 or 1")
        colours = _map(reader, "colours") if reader.has("colours") else None
    if valid.ndim != 2 or valid.shape[0] != valid.shape[1]:
        raise InvalidInput("valid", f"shape {valid.shape}", "(n, n)")
    for name, values in (("positions", positions), ("normals", normals), ("colours", colours)):
        if values is not None and values.shape != (*valid.shape, 3):
            raise InvalidInput(name, f"shape {values.shape}", f"{(*valid.shape, 3)}, as valid has it")
    return GeometryMaps(positions, normals, valid > 0, colours)


def _named(maps: GeometryMaps) -> dict[str, NDArray[np.generic]]:
    named: dict[str, NDArray[np.generic]] = {
        "positions": maps.positions,
        "normals": maps.normals,
        "valid": maps.valid.astype(np.uint8),
    }
    return named if maps.colours is None else named | {"colours": maps.colours}


def _map(reader: Reader, name: str) -> Pixels:
    values = reader.required(name, "f", "(n, n, 3) numbers")
    if not np.isfinite(values).all():
        raise InvalidInput(name, "not finite", "(n, n, 3) finite numbers")
    return values.astype(np.float32)


def map_png(maps: GeometryMaps, quantity: str) -> bytes:
    """An array as red, green and blue, u to the right and v up; transparent where not valid.

    Args:
        maps: of the image.
        quantity: "positions"; "normals", −1 to 1 from dark to bright; or "colours".

    Raises:
        InvalidInput: for the colours of an image without them.
    """
    values = getattr(maps, quantity)
    if values is None:
        raise InvalidInput("colours", "none", "the image of a mesh with colours")
    if quantity == "normals":
        values = 0.5 * (values + 1.0)
    shades = np.rint(np.clip(np.where(maps.valid[..., np.newaxis], values, 0.0), 0.0, 1.0) * 255.0)
    pixels = np.dstack((shades, 255.0 * maps.valid)).astype(np.uint8)
    # Images have their rows from top to bottom.
    upright = np.ascontiguousarray(pixels.transpose(1, 0, 2)[::-1])
    buffer = io.BytesIO()
    Image.fromarray(upright).save(buffer, "png", optimize=True)
    return buffer.getvalue()

"""Files of a geometry field in a folder: chart, geometry image, and memory-mapped tables."""

from __future__ import annotations

import io
import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import DTypeLike, NDArray
from PIL import Image

from bentray_kernels.arrays import Flags, Floats
from bentray_kernels.errors import InvalidInput
from bentray_kernels.geometry_field.image.geometry_image import GeometryImage
from bentray_kernels.meshes.mesh import Chart, TriangleMesh

from .atomic import atomic_replace
from .hdf5_reading import Reader, opened
from .hdf5_writing import atomic_hdf5, write_packed
from .npy_headers import PARSING, read_header

# Of geometry images.
FORMAT = "bentray-geometry-image"
VERSION = "1.0"

Pixels = NDArray[np.float32]


class FieldFiles:
    """Paths in one folder.

    Attributes:
        layout, figures: written when all files have their sizes, and when all are filled.
        stage: of the layout, while it is computed.
        outer: faces and fractions, (6n², 6n²) by entry and exit.
        inner: faces, (points, 6n²) by point and exit.
    """

    def __init__(self, folder: Path) -> None:
        self.chart, self.image = folder / "chart.h5", folder / "geometry-image.h5"
        self.layout, self.figures = folder / "layout.json", folder / "figures.json"
        self.stage = folder / "stage.json"
        self.points, self.starts = folder / "inner-points.npy", folder / "inner-starts.npy"
        self.outer = folder / "outer-faces.npy", folder / "outer-fractions.npy"
        self.inner = folder / "inner-faces.npy"


def write_chart(path: Path, chart: Chart) -> None:
    """Write a chart; ``path`` is replaced atomically."""
    with atomic_hdf5(path) as file:
        for name, values in (
            ("vertices", chart.mesh.vertices),
            ("faces", chart.mesh.faces),
            ("uv", chart.uv),
        ):
            file.create_dataset(name, data=values, track_times=False)


def read_chart(path: Path) -> Chart:
    """Read a chart.

    Raises:
        InvalidInput: naming the missing array.
    """
    with opened(path) as reader:
        vertices, faces, uv = (
            reader.required(name, "fi", "an array") for name in ("vertices", "faces", "uv")
        )
    return Chart(TriangleMesh(vertices, faces), uv)


def write_array(path: Path, values: NDArray[Any]) -> None:
    """Write a table; ``path`` is replaced atomically."""
    with atomic_replace(path) as partial, partial.open("wb") as file:
        np.save(file, values, allow_pickle=False)


def make_table(path: Path, shape: tuple[int, int], kind: DTypeLike) -> None:
    """Create an empty table for ``fill_rows``."""
    with atomic_replace(path) as partial:
        np.lib.format.open_memmap(partial, "w+", kind, shape).flush()


def mapped(path: Path, mode: Literal["c", "r+"] = "c") -> NDArray[Any]:
    """A memory map of a table; with mode "c" changes stay in this process, with "r+" they are written."""
    # A plain array, so that compiled functions accept it.
    with PARSING:
        return np.asarray(np.load(path, mmap_mode=mode, allow_pickle=False))


def fill_rows(path: Path, first: int, rows: NDArray[Any]) -> None:
    """Write rows into a table and synchronise them; other processes may write other rows."""
    with path.open("r+b") as file:
        read_header(file)
        # Written in place, not through a map: hosts that share a folder do not share memory.
        file.seek(file.tell() + first * rows[0].nbytes)
        file.write(np.ascontiguousarray(rows).tobytes())
        file.flush()
        os.fsync(file.fileno())


def read_json(path: Path) -> dict[str, Any]:
    """Read figures."""
    content: dict[str, Any] = json.loads(path.read_text())
    return content


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
    with atomic_hdf5(path, FORMAT, VERSION) as file:
        arrays = {
            "positions": maps.positions,
            "normals": maps.normals,
            "valid": maps.valid.astype(np.uint8),
            "colours": maps.colours,
        }
        write_packed(file, arrays)


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


def _map(reader: Reader, name: str) -> Pixels:
    values = reader.required(name, "f", "(n, n, 3) numbers")
    if not np.isfinite(values).all():
        raise InvalidInput(name, "not finite", "(n, n, 3) finite numbers")
    return values.astype(np.float32)


def quantity_png(maps: GeometryMaps, quantity: str) -> bytes:
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

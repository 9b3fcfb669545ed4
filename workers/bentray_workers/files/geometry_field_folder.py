"""Files of a geometry field in a folder: chart, geometry image, and memory-mapped tables."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import DTypeLike, NDArray

from bentray_kernels.meshes.mesh import Chart, TriangleMesh

from .atomic import atomic_replace, write_bytes
from .hdf5_reading import opened
from .hdf5_writing import atomic_hdf5
from .npy_headers import PARSING, read_header


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


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Write figures; ``path`` is replaced atomically."""
    write_bytes(path, (json.dumps(content, indent=2, allow_nan=False) + "\n").encode())


def read_json(path: Path) -> dict[str, Any]:
    """Read figures."""
    content: dict[str, Any] = json.loads(path.read_text())
    return content

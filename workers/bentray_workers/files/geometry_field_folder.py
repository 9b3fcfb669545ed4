"""The files of a geometry field in its folder: chart, geometry image, and tables to be mapped into memory."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from bentray_kernels.errors import InvalidInput
from bentray_kernels.meshes.mesh import Chart, TriangleMesh

from .atomic import replacing, write_bytes
from .hdf5_reading import Limits, opened
from .hdf5_writing import creating
from .npy_headers import PARSING


class FieldFiles(NamedTuple):
    """Paths in one folder.

    ``layout`` is written once all files are there with their sizes, ``figures`` once all are filled.
    """

    folder: Path

    @property
    def chart(self) -> Path:
        return self.folder / "chart.h5"

    @property
    def image(self) -> Path:
        return self.folder / "geometry-image.h5"

    @property
    def layout(self) -> Path:
        return self.folder / "layout.json"

    @property
    def figures(self) -> Path:
        return self.folder / "figures.json"

    @property
    def starts(self) -> Path:
        return self.folder / "inner-starts.npy"

    @property
    def points(self) -> Path:
        return self.folder / "inner-points.npy"

    @property
    def outer(self) -> tuple[Path, Path]:
        """Faces and fractions, (6n², 6n²) by entry and exit."""
        return self.folder / "outer-faces.npy", self.folder / "outer-fractions.npy"

    @property
    def inner(self) -> Path:
        """Faces, (points, 6n²) by point and exit."""
        return self.folder / "inner-faces.npy"


def write_chart(path: Path, chart: Chart) -> None:
    """Write a chart; ``path`` is replaced whole or not touched."""
    with creating(path) as file:
        for name, values in (
            ("vertices", chart.mesh.vertices),
            ("faces", chart.mesh.faces),
            ("uv", chart.uv),
        ):
            file.create_dataset(name, data=values, track_times=False)


def read_chart(path: Path) -> Chart:
    """Read what ``write_chart`` wrote.

    Raises:
        InvalidInput: naming what is missing.
    """
    with opened(path, Limits()) as reader:
        found = {name: reader.array(name, "fi", "an array") for name in ("vertices", "faces", "uv")}
    for name, values in found.items():
        if values is None:
            raise InvalidInput(name, "nothing", "an array")
    return Chart(TriangleMesh(found["vertices"], found["faces"]), found["uv"])  # type: ignore[arg-type]


def write_array(path: Path, values: NDArray[Any]) -> None:
    """A whole table, replaced whole or not touched."""
    with replacing(path) as partial, partial.open("wb") as file:
        np.save(file, values, allow_pickle=False)


def make_table(path: Path, shape: tuple[int, int], kind: DTypeLike) -> None:
    """A table of that shape with nothing in it, for ``fill_rows``."""
    with replacing(path) as partial:
        np.lib.format.open_memmap(partial, "w+", kind, shape).flush()


def mapped(path: Path, mode: Literal["c", "r+"] = "c") -> NDArray[Any]:
    """A table in memory as it is read; with mode "c" changes stay in this process, with "r+" they do not."""
    # As a plain array, so that compiled functions take it for one that is in memory.
    with PARSING:
        return np.asarray(np.load(path, mmap_mode=mode, allow_pickle=False))


def fill_rows(path: Path, first: int, rows: NDArray[Any]) -> None:
    """Write rows into a table, durably; other processes may be writing others."""
    with path.open("r+b") as file:
        with PARSING:
            np.lib.format.read_magic(file)
            np.lib.format.read_array_header_1_0(file)
        # Written in place, not through a map: hosts that share a folder share no pages of memory.
        file.seek(file.tell() + first * rows[0].nbytes)
        file.write(np.ascontiguousarray(rows).tobytes())
        file.flush()
        os.fsync(file.fileno())


def write_json(path: Path, content: dict[str, Any]) -> None:
    """A few figures, replaced whole or not touched."""
    write_bytes(path, (json.dumps(content, indent=2, allow_nan=False) + "\n").encode())


def read_json(path: Path) -> dict[str, Any]:
    """Read what ``write_json`` wrote."""
    found: dict[str, Any] = json.loads(path.read_text())
    return found

"""Tasks of the computation of a geometry field in a folder: layout, table rows, borders and accuracy."""

import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bentray_kernels.errors import InvalidInput
from bentray_kernels.geometry_field.image.geometry_image import GeometryImage, geometry_image
from bentray_kernels.geometry_field.image.subsampling import COARSEST, fitted_image
from bentray_kernels.geometry_field.layout.parameterisation import parameterise
from bentray_kernels.geometry_field.tables.inner_field import build_inner_rows, spread_points
from bentray_kernels.geometry_field.tables.outer_field import OuterField, build_rows, mark_borders
from bentray_kernels.meshes.geometric_error import GeometricError, geometric_error
from bentray_kernels.meshes.mesh import Chart
from bentray_kernels.meshes.surface import Surface, surface_of

from ..cluster.memory_cache import MemoryCache
from ..files.atomic import write_json
from ..files.geometry_field_folder import (
    FieldFiles,
    GeometryMaps,
    fill_rows,
    make_table,
    mapped,
    read_chart,
    read_json,
    write_array,
    write_chart,
    write_geometry_image,
)
from ..files.mesh import load_mesh
from .field_accuracy import accuracy
from .field_settings import FieldSettings, check_faces

# Entries of the inner table, 4 bytes each.
MAX_INNER = 2**28
# Stage after those of ``parameterise``: points of the image and rays of the tables.
SAMPLING = "sampling"
# Rays of one task: a second or two.
TASK_RAYS = 2**21

# Memory of a process for cached surfaces, and of one surface, bytes per face.
KEPT_BYTES = 2**29
FACE_BYTES = 320
_SURFACES = MemoryCache(KEPT_BYTES)


def parameterise_mesh(mesh_path: Path, settings: FieldSettings, folder: Path) -> None:
    """Task: chart, geometry image and empty tables; ``FieldFiles.layout`` last.

    Raises:
        InvalidInput: for a mesh that is too large, a threshold that no image reaches, or too large an inner
            table.
    """
    files, started = FieldFiles(folder), time.perf_counter()
    # A cluster may run a finished task again; this must not undo later ones.
    if files.layout.exists():
        return
    stored = load_mesh(mesh_path)
    check_faces(len(stored.mesh.faces))
    layout = parameterise(stored.mesh, partial(_write_stage, files))
    laid_out = time.perf_counter()
    _write_stage(files, SAMPLING, 0, 0)
    image, error = _image(layout.chart, settings)
    maps = GeometryMaps.from_geometry_image(image, stored.colours)
    sampled = time.perf_counter()
    if error is None:
        error = geometric_error(layout.chart.mesh, image.mesh())
    surface = surface_of(layout.chart)
    points, starts = spread_points(surface, settings.divisions)
    columns = 6 * settings.inner_samples**2
    if len(points) * columns > MAX_INNER:
        taken = f"{settings.divisions}, {len(points)} points by {columns} directions"
        accepted = f"at most {MAX_INNER} entries: fewer divisions or inner_samples"
        raise InvalidInput("divisions", taken, accepted)
    write_chart(files.chart, layout.chart)
    write_geometry_image(files.image, maps)
    write_array(files.points, points)
    write_array(files.starts, starts)
    for path, kind in zip(files.outer, (np.int32, np.float32), strict=True):
        make_table(path, (6 * settings.samples**2,) * 2, kind)
    make_table(files.inner, (len(points), columns), np.int32)
    figures = {
        "faces": len(stored.mesh.faces),
        "vertices": len(stored.mesh.vertices),
        "points": len(points),
        "conformal": layout.conformal,
        "area_stretch": layout.area_stretch,
        "median_quasi_conformal": float(np.median(layout.quasi_conformal)),
        "image_pixels": image.size,
        "image_rms": error.rms,
        "image_greatest": error.greatest,
        "parameterisation_seconds": laid_out - started,
        "image_seconds": sampled - laid_out,
        "error_seconds": time.perf_counter() - sampled,
    }
    write_json(files.layout, figures)


def _write_stage(files: FieldFiles, phase: str, done: int, total: int) -> None:
    """Record the stage of the layout for the job, which reads it while this task runs."""
    write_json(files.stage, {"phase": phase, "done": done, "total": total})


def _image(chart: Chart, settings: FieldSettings) -> tuple[GeometryImage, GeometricError | None]:
    """The geometry image, and its error if the size was chosen by it."""
    if settings.image_threshold > 0.0:
        fitted = fitted_image(chart, settings.image_threshold, settings.image_size, COARSEST)
        return fitted.image, fitted.error
    return geometry_image(chart, settings.image_size), None


def outer_rows(folder: Path, n: int, first: int, last: int, done: Path) -> None:
    """Task: rows of the outer table, and a file that marks them as finished."""
    if done.exists():
        return
    files, started = FieldFiles(folder), time.perf_counter()
    for path, rows in zip(files.outer, build_rows(_surface(files), n, first, last), strict=True):
        fill_rows(path, first, rows)
    write_json(done, {"seconds": time.perf_counter() - started})


def inner_rows(folder: Path, n: int, first: int, last: int, done: Path) -> None:
    """Task: rows of the inner table, and a file that marks them as finished."""
    if done.exists():
        return
    files, started = FieldFiles(folder), time.perf_counter()
    points = mapped(files.points)[first:last]
    fill_rows(files.inner, first, build_inner_rows(_surface(files), n, points))
    write_json(done, {"seconds": time.perf_counter() - started})


def finish(folder: Path, settings: FieldSettings, done: Path) -> dict[str, Any]:
    """Task: mark borders in the outer table, measure its accuracy, and return all figures.

    Args:
        folder: of the field.
        settings: of it.
        done: the folder with the marks of the other tasks.
    """
    files, started = FieldFiles(folder), time.perf_counter()
    faces, fractions = (mapped(path, "r+") for path in files.outer)
    mark_borders(settings.samples, faces)
    _synchronised(files.outer[0], faces)
    marked = time.perf_counter()
    field = OuterField(settings.samples, faces, fractions)
    figures = read_json(files.layout) | accuracy(_surface(files), field)
    for kind in ("outer", "inner"):
        spent = [read_json(path)["seconds"] for path in done.glob(f"{kind}-*.json")]
        figures[f"{kind}_seconds"] = float(sum(spent))
        figures[f"{kind}_tasks"] = len(spent)
    figures["border_seconds"] = marked - started
    figures["outer_bytes"] = sum(path.stat().st_size for path in files.outer)
    figures["inner_bytes"] = files.inner.stat().st_size
    for left in (*folder.glob("*.partial"), files.stage):
        left.unlink(missing_ok=True)
    write_json(files.figures, figures)
    return figures


def _synchronised(path: Path, faces: Any) -> None:
    """Flush a memory map to the disk."""
    base = faces.base
    while not isinstance(base, np.memmap):
        base = base.base
    base.flush()


def _surface(files: FieldFiles) -> Surface:
    """The surface of a chart, made once per process."""
    status = files.chart.stat()
    key = files.chart, status.st_mtime_ns, status.st_size
    faces = read_json(files.layout)["faces"]
    made: Surface = _SURFACES.get(key, FACE_BYTES * faces, lambda: surface_of(read_chart(files.chart)))
    return made

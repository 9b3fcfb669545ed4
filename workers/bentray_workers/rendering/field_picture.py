"""Pictures of meshes and their geometry fields: ray-traced scenes, geometry images and normal maps."""

from pathlib import Path

import numpy as np

from bentray_kernels.geometry_field.tracing.ray_tracer import TraceSettings, trace
from bentray_kernels.opencl import check_available
from bentray_kernels.refraction.edge_smoothing import smooth_edges
from bentray_kernels.refraction.supersampling import averaged

from ..cluster.task_cancellation import cancellation_check
from ..files.geometry_field_folder import FieldFiles, quantity_png, read_geometry_image
from ..images.png import png_of
from . import tiles
from .drawing_device import Drawn, drawn_by, name_of, tracer_for
from .field_cache import world_at
from .field_scenes import camera_of
from .field_view import LOOKUPS, FieldView
from .refraction import part_of

# Least difference between neighbouring rays at an edge of glass, levels of a colour.
EDGE_LEVELS = 40


def tile_image(folder: Path, view: FieldView, first: int, last: int, threads: int = 1) -> Drawn:
    """Task: rows of the picture of a mesh, the last one not included.

    Args:
        folder: of its field, or the file of the mesh.
        view: what to draw.
        first, last: rows.
        threads: that trace rays.

    Raises:
        InvalidInput: as ``world_at``, and for a device that is requested and cannot be used.
    """
    return drawn_by(lambda: _tile_image(folder, view, first, last, threads))


def _tile_image(folder: Path, view: FieldView, first: int, last: int, threads: int) -> Drawn:
    glass = view.mode.startswith("refract")
    # Edges of glass are smoothed twice, which uses the adjacent rays.
    margin = -(-3 // view.rays) if glass else 0
    top, bottom = max(first - margin, 0), min(last + margin, view.height)
    settings = TraceSettings(
        rows=(bottom - top) * view.rays,
        columns=view.width * view.rays,
        depth=view.depth,
        way=LOOKUPS[view.lookup],
        eye=LOOKUPS[view.eye],
        threads=threads,
    )
    # A request that cannot be met is an error before the tables are read.
    check_available(view.device)
    world, pause = world_at(folder, view), cancellation_check()
    camera = part_of(camera_of(view), top / view.height, bottom / view.height)
    # Published lookups of (u, v) exist for processors only.
    tracer = None if view.reads_image else tracer_for(world, settings.rows * settings.columns, view.device)
    pause()
    image = trace(world, camera, settings, pause) if tracer is None else tracer.trace(camera, settings)
    if glass:
        smooth_edges(image.astype(np.int16), EDGE_LEVELS, image)
    device = name_of(tracer.session, tracer.fault) if tracer else name_of(None)
    return Drawn(averaged(image, view.rays)[first - top : last - top], device)


def picture_png(folder: Path, view: FieldView) -> bytes:
    """Task: the whole picture, as PNG."""
    return png_of(*viewer_tile(folder, view, 0, view.height))


def viewer_tile(folder: Path, view: FieldView, first: int, last: int) -> Drawn:
    """Task: as ``tile_image``, in threads."""
    return tile_image(folder, view, first, last, tiles.viewer_threads())


def tasks_of(folder: Path, view: FieldView) -> tiles.PictureTasks:
    """The picture of a field in a folder, or of a mesh in a file, as tasks."""
    return tiles.tasks_of(picture_png, viewer_tile, folder, view)


def map_png(folder: Path, quantity: str) -> bytes:
    """Task: the geometry image of a field as PNG.

    Args:
        folder: of the field.
        quantity: "positions", "normals" or "colours".

    Raises:
        InvalidInput: for colours of a mesh without any.
    """
    return quantity_png(read_geometry_image(FieldFiles(folder).image), quantity)

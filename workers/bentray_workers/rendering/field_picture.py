"""Pictures of geometry fields: ray-traced scenes, whole or in tiles, geometry images and normal maps."""

from pathlib import Path

from bentray_kernels.geometry_field.tracing.ray_tracer import TraceSettings, trace
from bentray_kernels.opencl import check_available
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


def tile_image(folder: Path, view: FieldView, first: int, last: int, threads: int = 1) -> Drawn:
    """Task: rows of the picture of a field, the last one not included.

    Args:
        folder: of the field.
        view: what to draw.
        first, last: rows.
        threads: that trace rays.

    Raises:
        InvalidInput: as ``world_at``, and for a device that is requested and cannot be used.
    """
    return drawn_by(lambda: _tile_image(folder, view, first, last, threads))


def _tile_image(folder: Path, view: FieldView, first: int, last: int, threads: int) -> Drawn:
    settings = TraceSettings(
        rows=(last - first) * view.rays,
        columns=view.width * view.rays,
        depth=view.depth,
        way=LOOKUPS[view.lookup],
        eye=LOOKUPS[view.eye],
        threads=threads,
    )
    # A request that cannot be met is an error before the tables are read.
    check_available(view.device)
    world, pause = world_at(folder, view), cancellation_check()
    camera = part_of(camera_of(view), first / view.height, last / view.height)
    # Published lookups of (u, v) exist for processors only.
    tracer = None if view.reads_image else tracer_for(world, settings.rows * settings.columns, view.device)
    if tracer is None:
        return Drawn(averaged(trace(world, camera, settings, pause), view.rays), name_of(None))
    pause()
    image = averaged(tracer.trace(camera, settings), view.rays)
    return Drawn(image, name_of(tracer.session, tracer.fault))


def picture_png(folder: Path, view: FieldView) -> bytes:
    """Task: the whole picture, as PNG."""
    return png_of(*viewer_tile(folder, view, 0, view.height))


def viewer_tile(folder: Path, view: FieldView, first: int, last: int) -> Drawn:
    """Task: as ``tile_image``, in threads."""
    return tile_image(folder, view, first, last, tiles.viewer_threads())


def tasks_of(folder: Path, view: FieldView) -> tiles.PictureTasks:
    """The picture of the field in a folder as tasks."""
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

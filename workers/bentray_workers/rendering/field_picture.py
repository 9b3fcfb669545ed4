"""Pictures of geometry fields: ray-traced scenes, whole or in tiles, geometry images and normal maps."""

from __future__ import annotations

from pathlib import Path

from bentray_kernels.geometry_field.tracing.ray_tracer import TraceSettings, trace
from bentray_kernels.refraction.supersampling import averaged

from ..cluster.task_cancellation import cancellation_check
from ..files.geometry_field_folder import FieldFiles
from ..files.geometry_image import colour_png, normal_png, position_png, read_geometry_image
from ..images.png import Colours, png_of
from . import tiles
from .field_cache import world_at
from .field_scenes import camera_of
from .field_view import LOOKUPS, FieldView
from .refraction import part_of


def tile_image(folder: Path, view: FieldView, first: int, last: int, threads: int = 1) -> Colours:
    """Task: rows of the picture of a field, the last one not included.

    Args:
        folder: of the field.
        view: what to draw.
        first, last: rows.
        threads: that trace rays.

    Raises:
        InvalidInput: as ``world_at``.
    """
    settings = TraceSettings(
        rows=(last - first) * view.rays,
        columns=view.width * view.rays,
        depth=view.depth,
        way=LOOKUPS[view.lookup],
        eye=LOOKUPS[view.eye],
        threads=threads,
    )
    camera = part_of(camera_of(view), first / view.height, last / view.height)
    return averaged(trace(world_at(folder, view), camera, settings, cancellation_check()), view.rays)


def picture_png(folder: Path, view: FieldView) -> bytes:
    """Task: the whole picture, as PNG."""
    return png_of(viewer_tile(folder, view, 0, view.height))


def viewer_tile(folder: Path, view: FieldView, first: int, last: int) -> Colours:
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
    drawn = {"positions": position_png, "normals": normal_png, "colours": colour_png}
    return drawn[quantity](read_geometry_image(FieldFiles(folder).image))

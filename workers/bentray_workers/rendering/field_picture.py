"""Pictures of geometry fields: scenes traced whole or strip by strip, geometry images and normal maps."""

from __future__ import annotations

from pathlib import Path

from bentray_kernels.geometry_field.tracing.ray_tracer import TraceSettings, trace
from bentray_kernels.refraction.supersampling import averaged

from ..cluster.task_cancellation import look_out
from ..files.geometry_field_folder import FieldFiles
from ..files.geometry_image import colour_png, normal_png, position_png, read_geometry_image
from ..images.png import Colours, png_of
from . import tiles
from .field_cache import world_at
from .field_scenes import camera_of
from .field_view import LOOKUPS, FieldView
from .refraction import part_of


def strip_image(folder: Path, view: FieldView, first: int, last: int) -> Colours:
    """Task: rows of a field's picture, the last one not included.

    Raises:
        InvalidInput: as ``world_at``.
    """
    settings = TraceSettings(
        rows=(last - first) * view.rays,
        columns=view.width * view.rays,
        depth=view.depth,
        way=LOOKUPS[view.lookup],
        eye=LOOKUPS[view.eye],
    )
    camera = part_of(camera_of(view), first / view.height, last / view.height)
    return averaged(trace(world_at(folder, view), camera, settings, look_out()), view.rays)


def picture_png(folder: Path, view: FieldView) -> bytes:
    """Task: the whole picture, as PNG."""
    return png_of(strip_image(folder, view, 0, view.height))


def tasks_of(folder: Path, view: FieldView) -> tiles.Tasks:
    """The picture of the field in a folder as tasks for a cluster."""
    return tiles.tasks_of(picture_png, strip_image, folder, view)


def map_png(folder: Path, what: str) -> bytes:
    """Task: the geometry image of a field as PNG.

    Args:
        folder: of the field.
        what: "positions", "normals" or "colours".

    Raises:
        InvalidInput: for colours that the mesh has not.
    """
    drawn = {"positions": position_png, "normals": normal_png, "colours": colour_png}
    return drawn[what](read_geometry_image(FieldFiles(folder).image))

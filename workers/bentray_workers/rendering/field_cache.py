"""Cache of meshes and geometry fields: surfaces and scenes made once per process, memory-mapped tables."""

import math
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bentray_kernels.arrays import Floats
from bentray_kernels.errors import InvalidInput
from bentray_kernels.geometry_field.tables.inner_field import InnerField
from bentray_kernels.geometry_field.tables.outer_field import OuterField
from bentray_kernels.geometry_field.tables.reference_field import ReferenceField, reference_field
from bentray_kernels.geometry_field.tracing.packed_scene import World, moved, world_of
from bentray_kernels.geometry_field.tracing.scene import Shape
from bentray_kernels.meshes.mesh import Chart
from bentray_kernels.meshes.surface import surface_of
from bentray_kernels.requests.names import UpAxis

from ..cluster.memory_cache import MemoryCache
from ..files.geometry_field_folder import FieldFiles, mapped, read_chart, read_geometry_image, read_json
from ..files.mesh import load_mesh, stored_faces
from .field_scenes import scene_of
from .field_tasks import FACE_BYTES
from .field_view import FieldView
from .up_axis import standing_axis

# Memory of a process for cached fields, without memory-mapped tables.
KEPT_BYTES = 2 * 2**30
# Landscape and ball of each scene.
SCENE_BYTES = 32 * 2**20

# One of each per process.
_SHAPES = MemoryCache(KEPT_BYTES // 2)
_WORLDS = MemoryCache(KEPT_BYTES // 2)


class Textured(NamedTuple):
    """A shape, the axis on which it stands, and its colours over (u, v) as ``Material.texture``, or None."""

    shape: Shape
    up: UpAxis
    texture: Floats | None = None


def world_at(source: Path, view: FieldView) -> World:
    """The scene of a mesh, cached or new.

    Args:
        source: the folder of its field, or its own file, of which all rays are intersected exactly.
        view: what is drawn.

    Raises:
        InvalidInput: from the files.
    """
    bare, files = source.is_file(), FieldFiles(source)
    stamp = source, (source if bare else files.figures).stat().st_mtime_ns
    figures = {"faces": stored_faces(source), "image_pixels": 0} if bare else read_json(files.figures)
    surface_bytes = FACE_BYTES * figures["faces"]
    image_bytes = 24 * figures["image_pixels"] ** 2
    made: Textured = _SHAPES.get(
        stamp, surface_bytes + image_bytes, lambda: bare_shape(source) if bare else shape_of(files)
    )
    if view.up == "auto":
        view = replace(view, up=made.up)
    if view.reads_image:
        made = _with_reference(files, stamp, made, figures["image_pixels"])
    # Equal entries are marked for each scene, a byte each; a second surface is copied.
    entries = len(made.shape.outer.faces) ** 2 if made.shape.outer else 0
    appearance = view.scene, view.mode, view.index, view.share, view.up, view.reads_image
    world: World = _WORLDS.get(
        (stamp, appearance),
        entries + surface_bytes + SCENE_BYTES,
        lambda: world_of(scene_of(made.shape, made.texture, replace(view, positions_m=()))),
    )
    # Objects that move share all tables with those that stand still.
    return moved(world, scene_of(made.shape, made.texture, view)) if view.positions_m else world


def _with_reference(files: FieldFiles, stamp: tuple[Path, int], made: Textured, pixels: int) -> Textured:
    """A shape with the published tables too, made where a view reads them.

    Raises:
        InvalidInput: for a field with too many samples or points for them.
    """
    outer, inner = made.shape.outer, made.shape.inner
    if outer is None or inner is None:
        return made

    def make() -> ReferenceField:
        maps = read_geometry_image(files.image)
        rays = inner, mapped(files.points)
        return reference_field(made.shape.surface, outer, maps.positions, maps.normals, maps.valid, rays)

    size = 8 * len(outer.faces) ** 2 + 24 * pixels**2 + 8 * inner.faces.size
    reference: ReferenceField = _SHAPES.get((*stamp, "reference"), size, make, 2 * size)
    return made._replace(shape=replace(made.shape, reference=reference))


def bare_shape(path: Path) -> Textured:
    """The surface of a mesh file, without field and colours.

    Raises:
        InvalidInput: from the file.
    """
    mesh = load_mesh(path).mesh.in_unit_cube()
    surface = surface_of(Chart(mesh, mesh.corners[..., :2]))
    return Textured(Shape(surface), standing_axis(mesh.vertices))


def shape_of(files: FieldFiles) -> Textured:
    """The surface of a field with memory-mapped tables.

    Raises:
        InvalidInput: from the files, and for tables that do not match the surface.
    """
    chart = read_chart(files.chart)
    surface = surface_of(chart)
    faces, fractions = (mapped(path) for path in files.outer)
    starts, inner = mapped(files.starts), mapped(files.inner)
    if len(starts) != len(surface.triangles):
        raise InvalidInput(
            "inner-starts", f"{len(starts)} faces", f"{len(surface.triangles)}, as the chart has"
        )
    shape = Shape(
        surface,
        OuterField(_samples(faces.shape[1]), faces, fractions),
        InnerField(_samples(inner.shape[1]), starts, inner),
    )
    colours = read_geometry_image(files.image).colours
    texture = None if colours is None else np.clip(colours.transpose(1, 0, 2), 0.0, 1.0).astype(np.float64)
    return Textured(shape, standing_axis(chart.mesh.vertices), texture)


def _samples(columns: int) -> int:
    return math.isqrt(columns // 6)

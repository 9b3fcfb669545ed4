"""Scenes of a mesh and its geometry field, and their cameras."""

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from bentray_kernels.arrays import Floats
from bentray_kernels.geometry_field.tracing.scene import Ground, Instance, Material, Scene, Shape, placed
from bentray_kernels.meshes.example_surfaces import sphere
from bentray_kernels.meshes.mesh import Chart
from bentray_kernels.meshes.surface import surface_of
from bentray_kernels.refraction import Camera, orthographic, perspective

from ..images.landscape import landscape
from .field_view import FieldView
from .up_axis import UPRIGHT

CLAY, RED, BLUE, SILVER = (0.85, 0.62, 0.42), (0.85, 0.3, 0.22), (0.28, 0.42, 0.85), (0.92, 0.92, 0.95)
DARK = np.full((2, 4, 3), 0.06)
GROUND = Ground(0.0, 0.5, 7.0, ((0.86, 0.84, 0.79), (0.32, 0.36, 0.42)))

# Of the objects on the ground of each scene, m.
PLACES = {
    "object": (),
    "mirror-ball": ((-0.85, -0.45), (0.85, -0.45), (0.0, 0.65)),
    "two-mirrors": ((-0.6, 0.1), (0.6, -0.1)),
}
# Resolution of the reflecting ball.
BALL = 96
VIEW_DEG = 38.0


class Framing(NamedTuple):
    """The view of a camera at zoom 1: a ball around a point, m."""

    centre: tuple[float, float, float]
    radius: float


FRAMINGS = {
    "object": Framing((0.0, 0.0, 0.0), 0.75),
    "mirror-ball": Framing((0.0, 0.1, 0.55), 1.6),
    "two-mirrors": Framing((0.0, 0.0, 0.45), 1.3),
}


def scene_of(shape: Shape, texture: Floats | None, view: FieldView) -> Scene:
    """The scene of a view.

    Args:
        shape: the mesh and its fields.
        texture: (n, n, 3) colours of the mesh over (u, v), as ``Material.texture``, or None.
        view: the settings, with an axis that is up.
    """
    if view.scene == "object":
        instances = (
            Instance(shape, _turned(view, (0.0, 0.0, 0.0), 1.0, 0.0), _material(view, CLAY, texture)),
        )
        return Scene(instances, DARK if view.mode == "self-only" else landscape())
    # The mesh is the first shape, so its tables are not copied.
    left, right = _material(view, CLAY, texture), _material(view, BLUE, texture)
    positions = places_of(view)
    if view.scene == "two-mirrors":
        pair = (
            _upright(shape, view, positions[0], 1.1, 0.0, left),
            _upright(shape, view, positions[1], 1.1, 180.0, right),
        )
        return Scene(pair, landscape(), GROUND)
    ball = Instance(_ball(), placed((*positions[2], 0.75), 1.5), Material(colour=SILVER, mirror=0.9))
    both = (
        _upright(shape, view, positions[0], 0.85, 0.0, left),
        _upright(shape, view, positions[1], 0.85, 90.0, _material(view, RED, texture)),
    )
    return Scene((*both, ball), landscape(), GROUND)


def places_of(view: FieldView) -> Sequence[tuple[float, float]]:
    """x and y of the objects on the ground, m."""
    given = view.positions_m
    return list(zip(given[::2], given[1::2], strict=True)) if given else PLACES[view.scene]


def camera_of(view: FieldView) -> Camera:
    """The camera of a view; the shorter side of the picture holds the scene at zoom 1."""
    frame = FRAMINGS[view.scene]
    azimuth, elevation = math.radians(view.azimuth_deg), math.radians(view.elevation_deg)
    level = math.cos(elevation)
    towards = np.array([level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation)])
    aspect = view.height / view.width
    wider = max(1.0, 1.0 / aspect) / view.zoom
    away = frame.radius / math.sin(math.radians(0.5 * VIEW_DEG))
    eye, up = np.array(frame.centre) + away * towards, (0.0, 0.0, 1.0)
    if view.camera == "orthographic":
        return orthographic(eye, -towards, up, 2.0 * frame.radius * wider, aspect)
    tangent = math.tan(math.radians(0.5 * VIEW_DEG)) * wider
    return perspective(eye, frame.centre, up, 2.0 * math.degrees(math.atan(tangent)), aspect)


def _material(view: FieldView, colour: tuple[float, float, float], texture: Floats | None) -> Material:
    if view.mode == "diffuse":
        return Material(colour=colour, texture=texture)
    if view.mode.startswith("refract"):
        bends = "single" if view.mode == "refract-single" else "full"
        return Material(colour=colour, texture=texture, glass=view.share, index=view.index, refraction=bends)
    itself = view.mode.startswith("self")
    return Material(colour=colour, texture=texture, mirror=view.share, self_reflection=itself)


def _turned(view: FieldView, centre: tuple[float, float, float], size: float, turn_deg: float) -> Floats:
    """Transform of the unit cube: its up axis to z, rotated about the vertical."""
    about = placed((0.0, 0.0, 0.0), size, (0.0, 0.0, 1.0), turn_deg)[:, :3]
    linear = about @ UPRIGHT[view.up]
    return np.column_stack([linear, np.array(centre) - linear @ np.full(3, 0.5)])


def _upright(
    shape: Shape, view: FieldView, at: tuple[float, float], size: float, turn_deg: float, material: Material
) -> Instance:
    """The mesh on the ground."""
    axis = "xyz".index(view.up[-1])
    heights = shape.surface.triangles[:, [axis, axis + 3, axis + 6]]
    lowest = 1.0 - float(heights.max()) if view.up.startswith("-") else float(heights.min())
    return Instance(shape, _turned(view, (*at, (0.5 - lowest) * size), size, turn_deg), material)


@cache
def _ball() -> Shape:
    """The reflecting ball, intersected exactly: only the mesh has a field."""
    mesh = sphere(BALL, BALL).in_unit_cube()
    return Shape(surface_of(Chart(mesh, mesh.corners[..., :2])))

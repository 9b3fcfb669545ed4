"""Pictures of volumes as glass: whole, or strip by strip as tasks of the render lane."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bentray_kernels.arrays import Floats
from bentray_kernels.refraction import (
    Backdrop,
    Camera,
    Light,
    Plane,
    RenderSettings,
    Scene,
    backdrop_of,
    checkerboard,
    orthographic,
    perspective,
    render,
    shade,
)
from bentray_kernels.refraction.supersampling import averaged

from ..cluster.task_cancellation import look_out
from ..images.backdrop_card import backdrop_card
from ..images.png import Colours, png_of
from . import tiles
from .refraction_view import RefractionView
from .scene_cache import scene_at

# Of what is shown at zoom 1, over the longest side of the volume.
ROOM = 1.25
# Of the eye from the middle of the volume, in its diagonals.
EYE_DISTANCE = 2.5
BEYOND = (90, 90, 90)


class Strip(NamedTuple):
    """Rows of a picture.

    Attributes:
        image: (rows, width, 3) 8-bit RGB.
        position_m: (rows, width, 2) where each ray ends on the backdrop, from its middle, right and down, m;
            NaN where it ends nowhere; None of a shaded picture. With real supersampling the mean of a pixel.
    """

    image: Colours
    position_m: Floats | None


def picture_png(path: Path, view: RefractionView) -> bytes:
    """Task: the whole picture of a volume or reconstruction file, as PNG.

    Raises:
        InvalidInput: as ``scene_at``.
    """
    return png_of(strip(scene_at(path, view), view, 0, view.height).image)


def strip_image(path: Path, view: RefractionView, first: int, last: int) -> Colours:
    """Task: the rows ``first`` to ``last`` of it, the last one not included."""
    return strip(scene_at(path, view), view, first, last).image


def tasks_of(path: Path, view: RefractionView) -> tiles.Tasks:
    """The picture of a file as tasks for a cluster."""
    return tiles.tasks_of(picture_png, strip_image, path, view)


def strip(scene: Scene, view: RefractionView, first: int, last: int, card: Colours | None = None) -> Strip:
    """Draw rows of a picture.

    Args:
        scene: the volume; its middle lies at 0.
        view: what to draw.
        first, last: rows, the last one not included.
        card: picture for the backdrop, 8-bit RGB; None: our test card.
    """
    # Post-refraction supersampling looks at the rows beside.
    margin = 1 if view.supersampling == "prss" else 0
    top, bottom = max(first - margin, 0), min(last + margin, view.height)
    camera = part_of(camera_of(scene, view), top / view.height, bottom / view.height)
    rows = bottom - top
    own = slice(first - top, last - top)
    if view.mode == "shaded":
        shaded = shade(scene, camera, _light(view), rows * view.times, view.width * view.times)
        return Strip(averaged(shaded.image, view.times)[own], None)
    settings = RenderSettings(
        rows=rows,
        columns=view.width,
        depth=view.depth,
        supersampling=view.supersampling,
        degree=view.degree,
        fresnel=view.fresnel,
        seed=top,
    )
    picture = render(scene, camera, _backdrop(scene, view, card), settings, pause=look_out())
    position = picture.position_m.reshape(rows, view.times, view.width, view.times, 2).mean(axis=(1, 3))
    return Strip(picture.image[own], position[own])


def camera_of(scene: Scene, view: RefractionView) -> Camera:
    """The camera of a view, as wide as the volume's longest side and some room at zoom 1."""
    ahead, _, down = frame_of(view)
    diagonal, width = _diagonal(scene), _width(scene, view)
    aspect = view.height / view.width
    if view.camera == "orthographic":
        return orthographic(-diagonal * ahead, ahead, -down, width, aspect)
    eye = EYE_DISTANCE * diagonal
    return perspective(-eye * ahead, (0.0, 0.0, 0.0), -down, _degrees(0.5 * width / eye), aspect)


def frame_of(view: RefractionView) -> tuple[Floats, Floats, Floats]:
    """Unit vectors ahead, to the right and down in the picture; z is up where it can be."""
    azimuth, elevation = math.radians(view.azimuth_deg), math.radians(view.elevation_deg)
    east, north = math.cos(azimuth), math.sin(azimuth)
    ahead = -np.array([math.cos(elevation) * east, math.cos(elevation) * north, math.sin(elevation)])
    right = np.array([-north, east, 0.0])
    return ahead, right, np.cross(ahead, right)


def _backdrop(scene: Scene, view: RefractionView, card: Colours | None) -> Backdrop:
    ahead, right, down = frame_of(view)
    distance = view.backdrop_distance * _diagonal(scene)
    side = _width(scene, view) * min(1.0, view.height / view.width)
    if view.camera == "perspective":
        side *= 1.0 + distance / (EYE_DISTANCE * _diagonal(scene))
    centre = tuple((distance * ahead).tolist())
    if view.backdrop == "checkerboard":
        return backdrop_of(
            [checkerboard(centre, (side * right).tolist(), (side * down).tolist(), view.squares)], BEYOND
        )
    picture = backdrop_card() if card is None else card
    wide = side * picture.shape[1] / picture.shape[0]
    edges = [tuple((length * edge).tolist()) for length, edge in ((wide, right), (side, down))]
    return backdrop_of([Plane(centre, edges[0], edges[1], picture, endless=True)], BEYOND)


def _light(view: RefractionView) -> Light:
    """From behind the camera's left shoulder."""
    ahead, right, down = frame_of(view)
    towards = -ahead - 0.6 * right - 0.8 * down
    return Light(tuple((towards / np.linalg.norm(towards)).tolist()), background=BEYOND)


def part_of(camera: Camera, top: float, bottom: float) -> Camera:
    """The camera of a strip, from and to a part of the height."""
    middle, share = 0.5 * (top + bottom) - 0.5, bottom - top
    origin, direction = camera.origin.copy(), camera.direction.copy()
    for rays in (origin, direction):
        rays[0] += middle * rays[2]
        rays[2] *= share
    return replace(camera, origin=origin, direction=direction)


def _extent(scene: Scene) -> Floats:
    return np.asarray((scene.grid[1] - scene.grid[0]) * scene.spacing)


def _diagonal(scene: Scene) -> float:
    return float(np.linalg.norm(_extent(scene)))


def _width(scene: Scene, view: RefractionView) -> float:
    """Of the picture at the middle of the volume, m; its shorter side holds the volume."""
    return ROOM * float(_extent(scene).max()) / view.zoom * max(1.0, view.width / view.height)


def _degrees(tangent: float) -> float:
    """The angle across a picture, from the tangent of half of it."""
    return 2.0 * math.degrees(math.atan(tangent))

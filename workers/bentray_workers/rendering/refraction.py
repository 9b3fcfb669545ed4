"""Refractive rendering of volumes: whole pictures, or tiles of rows."""

import math
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bentray_kernels.arrays import Floats
from bentray_kernels.opencl import check_available, computed
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

from ..cluster.task_cancellation import cancellation_check
from ..images.backdrop_card import backdrop_card
from ..images.png import Colours, png_of
from . import tiles
from .drawing_device import PROCESSOR, Drawn, caster_for, name_of
from .refraction_view import RefractionView
from .scene_cache import scene_at
from .up_axis import UPRIGHT, standing_axis_of

# Width of the view at zoom 1, relative to the longest side of the volume.
VIEW_MARGIN = 1.25
# Distance of the eye from the centre of the volume, in its diagonals.
EYE_DISTANCE = 2.5
BEYOND = (90, 90, 90)
# Of a warped backdrop: half the height of its waves, in shorter sides of the picture; nodes along each edge.
WAVE_HEIGHT, WAVE_NODES = 0.1, 97


class Tile(NamedTuple):
    """Rows of a picture.

    Attributes:
        image: (rows, width, 3) 8-bit RGB.
        position_m: (rows, width, 2) where each ray meets the backdrop, from its centre, right and down, m;
            NaN where it meets none; None for a shaded picture. With real supersampling the mean of a pixel.
        device: that drew them.
    """

    image: Colours
    position_m: Floats | None
    device: str = PROCESSOR

    @property
    def drawn(self) -> Drawn:
        """The picture alone."""
        return Drawn(self.image, self.device)


def picture_png(path: Path, view: RefractionView) -> bytes:
    """Task: the whole picture of a volume or reconstruction file, as PNG.

    Raises:
        InvalidInput: as ``scene_at``.
    """
    return png_of(*viewer_tile(path, view, 0, view.height))


def viewer_tile(path: Path, view: RefractionView, first: int, last: int) -> Drawn:
    """Task: as ``tile_image``, in threads."""
    check_available(view.device)
    return draw_tile(scene_at(path, view), view, first, last, threads=tiles.viewer_threads()).drawn


def tile_image(path: Path, view: RefractionView, first: int, last: int) -> Drawn:
    """Task: the rows ``first`` to ``last`` of it, the last one not included."""
    check_available(view.device)
    return draw_tile(scene_at(path, view), view, first, last).drawn


def tasks_of(path: Path, view: RefractionView) -> tiles.PictureTasks:
    """The picture of a file as tasks."""
    return tiles.tasks_of(picture_png, viewer_tile, path, view)


def draw_tile(
    scene: Scene,
    view: RefractionView,
    first: int,
    last: int,
    card: Colours | None = None,
    threads: int = 1,
) -> Tile:
    """Draw rows of a picture.

    Args:
        scene: the volume, centred at 0.
        view: what to draw.
        first, last: rows, the last one not included.
        card: picture for the backdrop, 8-bit RGB; None: the test card.
        threads: that trace rays, where compiled code does.

    Raises:
        InvalidInput: for a device that is requested and cannot be used.
    """
    if view.up == "auto":
        view = replace(view, up=standing_axis_of(scene.field, scene.spacing))
    tile, lost = computed(lambda: _draw_tile(scene, view, (first, last), card, threads))
    return tile._replace(device=f"{PROCESSOR}: {lost}") if lost else tile


def _draw_tile(
    scene: Scene, view: RefractionView, rows_drawn: tuple[int, int], card: Colours | None, threads: int
) -> Tile:
    first, last = rows_drawn
    # Post-refraction supersampling uses the adjacent rows, and smooths edges twice.
    smooth = view.mode == "refract" and view.supersampling == "prss"
    margin = 3 if smooth else 0
    top, bottom = max(first - margin, 0), min(last + margin, view.height)
    camera = part_of(camera_of(scene, view), top / view.height, bottom / view.height)
    rows = bottom - top
    own = slice(first - top, last - top)
    if view.mode == "shaded":
        size = rows * view.times, view.width * view.times
        shaded = shade(scene, camera, _light(view), *size, threads, cancellation_check())
        return Tile(averaged(shaded.image, view.times)[own], None)
    settings = RenderSettings(
        rows=rows,
        columns=view.width,
        depth=view.depth,
        supersampling=view.supersampling,
        degree=view.degree,
        smooth_edges=smooth,
        fresnel=view.fresnel,
        ray_spacing=view.ray_spacing,
        seed=top,
        threads=threads,
    )
    rays = rows * view.width * (view.times / view.ray_spacing) ** 2
    caster = caster_for(scene, math.ceil(rays), view.device)
    backdrop = _backdrop(scene, view, card)
    picture = render(scene, camera, backdrop, settings, caster, cancellation_check())
    position = picture.position_m.reshape(rows, view.times, view.width, view.times, 2).mean(axis=(1, 3))
    device = name_of(caster.session, caster.fault) if caster else PROCESSOR
    return Tile(picture.image[own], position[own], device)


def camera_of(scene: Scene, view: RefractionView) -> Camera:
    """The camera of a view; at zoom 1 it shows the longest side of the volume and a margin."""
    ahead, _, down = frame_of(view)
    diagonal, width = _diagonal(scene), _width(scene, view)
    aspect = view.height / view.width
    if view.camera == "orthographic":
        return orthographic(-diagonal * ahead, ahead, -down, width, aspect)
    eye = EYE_DISTANCE * diagonal
    return perspective(-eye * ahead, (0.0, 0.0, 0.0), -down, _degrees(0.5 * width / eye), aspect)


def frame_of(view: RefractionView) -> tuple[Floats, Floats, Floats]:
    """Unit vectors ahead, to the right and down in the picture, in the axes of the volume."""
    azimuth, elevation = math.radians(view.azimuth_deg), math.radians(view.elevation_deg)
    east, north = math.cos(azimuth), math.sin(azimuth)
    ahead = -np.array([math.cos(elevation) * east, math.cos(elevation) * north, math.sin(elevation)])
    right = np.array([-north, east, 0.0])
    upright = UPRIGHT[view.up]
    return ahead @ upright, right @ upright, np.cross(ahead, right) @ upright


def _backdrop(scene: Scene, view: RefractionView, card: Colours | None) -> Backdrop:
    ahead, right, down = frame_of(view)
    distance = view.backdrop_distance * _diagonal(scene)
    side = _width(scene, view) * min(1.0, view.height / view.width)
    if view.camera == "perspective":
        side *= 1.0 + distance / (EYE_DISTANCE * _diagonal(scene))
    centre = tuple((distance * ahead).tolist())
    relief = _waves(side) if view.backdrop.startswith("warped-") else None
    if view.backdrop.endswith("checkerboard"):
        plane = checkerboard(centre, (side * right).tolist(), (side * down).tolist(), view.squares)
    else:
        picture = backdrop_card() if card is None else card
        wide = side * picture.shape[1] / picture.shape[0]
        edges = [tuple((length * edge).tolist()) for length, edge in ((wide, right), (side, down))]
        plane = Plane(centre, edges[0], edges[1], picture, endless=True)
    return backdrop_of([replace(plane, relief=relief)], BEYOND)


def _waves(side: float) -> Floats:
    """Heights of a wavy surface over a rectangle, m, nowhere nearer to the volume than the rectangle."""
    u, v = np.linspace(-0.5, 0.5, WAVE_NODES)[None, :], np.linspace(-0.5, 0.5, WAVE_NODES)[:, None]
    return np.asarray(WAVE_HEIGHT * side * (1.0 - np.cos(4.0 * np.pi * u) * np.cos(4.0 * np.pi * v)))


def _light(view: RefractionView) -> Light:
    """From above and left of the camera."""
    ahead, right, down = frame_of(view)
    towards = -ahead - 0.6 * right - 0.8 * down
    return Light(tuple((towards / np.linalg.norm(towards)).tolist()), background=BEYOND)


def part_of(camera: Camera, top: float, bottom: float) -> Camera:
    """The camera of a tile between two fractions of the height."""
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
    """Width of the view at the centre of the volume, m; its shorter side holds the volume."""
    return VIEW_MARGIN * float(_extent(scene).max()) / view.zoom * max(1.0, view.width / view.height)


def _degrees(tangent: float) -> float:
    """The angle across a picture, from the tangent of half of it."""
    return 2.0 * math.degrees(math.atan(tangent))

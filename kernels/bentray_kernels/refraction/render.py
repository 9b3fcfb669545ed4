"""Refractive rendering of a volume before a backdrop."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..errors import InvalidInput
from .backdrop import Backdrop, Colours, locate
from .camera import Camera
from .caster import LOST, allocate_results, cast, medium_of
from .caster_opencl import OpenCLCaster
from .coarse_rays import Hits, interpolate_rays
from .edge_smoothing import smooth_edges
from .scene import Scene
from .supersampling import averaged, point_colours, post_refraction_colours

# Rows of the image cast in one call on the CPU.
TILE_ROWS = 16

SUPERSAMPLING = ("none", "prss", "real")


@dataclass(frozen=True)
class RenderSettings:
    """Settings of a rendering.

    Attributes:
        rows, columns: pixels.
        depth: most interfaces that a ray may meet; where one meets more, the picture shows the
            backdrop's colour beyond all planes.
        supersampling: "none"; "prss", after refraction (4.3.3); "real", more rays.
        degree: for "prss" as in ``post_refraction_colours``; for "real" rays a pixel along each axis.
        smooth_edges: whether rays that met another number of interfaces than a neighbour, or ended on another
            plane, get a mean of colours, see ``edge_smoothing``.
        fresnel: whether light is attenuated by reflection at each interface.
        structure, roots, step: as in ``Scene.search``.
        ray_spacing: pixels between rays along both sides, for a preview: where rays end is interpolated
            between them, see ``coarse_rays``. 1 with real supersampling.
        seed: of the jitter of real supersampling; None: regular rays.
        threads: number of threads for tiles of rows.

    Raises:
        InvalidInput: for a number below 1, or another name.
    """

    rows: int = 256
    columns: int = 256
    depth: int = 16
    supersampling: str = "prss"
    degree: int = 1
    smooth_edges: bool = False
    fresnel: bool = False
    structure: str = "octree"
    roots: str = "certain"
    step: float = 0.1
    ray_spacing: int = 1
    seed: int | None = 0
    threads: int = 1

    def __post_init__(self) -> None:
        for name in ("rows", "columns", "depth", "degree", "ray_spacing", "threads"):
            if getattr(self, name) < 1:
                raise InvalidInput(name, getattr(self, name), "a whole number >= 1")
        if self.supersampling not in SUPERSAMPLING:
            raise InvalidInput("supersampling", self.supersampling, "one of " + ", ".join(SUPERSAMPLING))
        if self.ray_spacing > 1 and self.supersampling == "real":
            raise InvalidInput("ray_spacing", self.ray_spacing, "1 with real supersampling")


@dataclass(frozen=True)
class Picture:
    """An image and the results for each pixel; with real supersampling, for each ray.

    Attributes:
        image: (rows, columns, 3) 8-bit RGB.
        position_m: (rows, columns, 2) where the ray ends, from the middle of its plane, right and down, m;
            NaN where it ends on none.
        plane: (rows, columns) number of the plane, −1 for none.
        fate: (rows, columns) ``caster.MISSED``, ``REFRACTED`` or ``LOST``.
        crossed: (rows, columns) interfaces met.
        weight: (rows, columns) share of unpolarised energy on this path.
    """

    image: Colours
    position_m: Floats
    plane: NDArray[np.int8]
    fate: NDArray[np.uint8]
    crossed: NDArray[np.int16]
    weight: Floats


def render(
    scene: Scene,
    camera: Camera,
    backdrop: Backdrop,
    settings: RenderSettings,
    caster: OpenCLCaster | None = None,
    pause: Callable[[], None] = lambda: None,
) -> Picture:
    """Cast one ray per pixel, or more, and colour each by its intersection with the backdrop.

    Args:
        scene: the volume, ``Scene.build``.
        camera: ``camera.orthographic`` or ``perspective``.
        backdrop: ``backdrop_of``.
        settings: the rest.
        caster: follows the rays of this scene on an OpenCL device, ``caster_opencl.on_the_device``; None for
            this CPU.
        pause: called before every tile, possibly in another thread; an exception ends the rendering.
    """
    times = settings.degree if settings.supersampling == "real" else 1
    spacing = settings.ray_spacing
    rows, columns = -(-times * settings.rows // spacing), -(-times * settings.columns // spacing)
    pixels = _pixel_positions(rows, columns, settings.seed if settings.supersampling == "real" else None)
    if spacing > 1:
        # The last ray may lie beyond the edge of the picture.
        covered = np.array([columns / settings.columns, rows / settings.rows])
        pixels = (pixels + 0.5) * spacing * covered - 0.5
    traced = allocate_results(rows * columns)
    plane, where = np.empty(rows * columns, dtype=np.int8), np.empty((rows * columns, 2))
    medium = medium_of(scene, settings.structure)
    search = scene.search(settings.structure, settings.roots, settings.step)
    # A device takes all rays at once.
    follow, at_once = (cast, TILE_ROWS) if caster is None else (caster.cast, rows)

    def tile(rays: slice) -> None:
        pause()
        filled = traced.part(rays)
        follow(medium, search, (camera.origin, camera.direction), pixels[rays], settings.depth, filled)
        locate(backdrop, filled.point, filled.direction, plane[rays], where[rays])

    with ThreadPoolExecutor(settings.threads) as pool:
        list(pool.map(tile, _tiles(rows, columns, at_once)))
    shape = (rows, columns)
    lost = traced.fate == LOST
    plane[lost], where[lost] = -1, np.nan
    found: tuple[Any, ...] = (plane, where, traced.fate, traced.crossed, traced.weight)
    hits = Hits(*(array.reshape(*shape, *array.shape[1:]) for array in found))
    if spacing > 1:
        hits = _of_pixels(hits, settings)
    image = np.empty((*hits.plane.shape, 3), dtype=np.uint8)
    lit = hits if settings.fresnel else hits._replace(weight=np.ones(hits.plane.shape))
    if settings.supersampling == "prss":
        post_refraction_colours(backdrop, lit, settings.degree, image)
    else:
        point_colours(backdrop, lit, image)
    if settings.smooth_edges:
        smooth_edges(np.stack([hits.crossed, hits.plane.astype(np.int16)], axis=2), 1, image)
    # Where there is no plane, any edge leaves NaN what it is.
    position = hits.where * backdrop.edges[hits.plane]
    image = image if times == 1 else averaged(image, times)
    return Picture(image, position, hits.plane, hits.fate, hits.crossed, hits.weight)


def _of_pixels(rays: Hits, settings: RenderSettings) -> Hits:
    """Hits of all pixels, interpolated between the rays."""
    shape = settings.rows, settings.columns
    pixels = Hits(*(np.empty((*shape, *array.shape[2:]), array.dtype) for array in rays))
    interpolate_rays(settings.ray_spacing, rays, pixels)
    return pixels


def _tiles(rows: int, columns: int, at_once: int) -> Iterator[slice]:
    for first in range(0, rows, at_once):
        yield slice(first * columns, min(first + at_once, rows) * columns)


def _pixel_positions(rows: int, columns: int, seed: int | None) -> Floats:
    """(rows·columns, 2) u and v of the rays: middles of squares, or a random place in each."""
    within = (
        np.full((rows, columns, 2), 0.5)
        if seed is None
        else np.random.default_rng(seed).random((rows, columns, 2))
    )
    u = (np.arange(columns) + within[..., 0]) / columns - 0.5
    v = (np.arange(rows)[:, None] + within[..., 1]) / rows - 0.5
    return np.stack([u.ravel(), v.ravel()], axis=1)

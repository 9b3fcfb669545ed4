"""The volumes of chapters 3 and 4 as glass before a backdrop, for their figures."""

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bentray_kernels.phantoms import (
    ONE_HOLE,
    TABLE7_SIDE_M,
    TWO_HOLES,
    FringeSphere,
    MarschnerLobb,
    eight_bit,
    sampled,
    table7,
)
from bentray_kernels.refraction import (
    Backdrop,
    Camera,
    Layers,
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
from bentray_kernels.splines import Spline

NODES, PIXELS = 64, 352
REPEATS = 5
INDEX = 1.5

# Looked at along z, the backdrop two edges behind the middle; all volumes are 2 long.
FRONT = orthographic((0.0, 0.0, -3.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), 1.7)
BEHIND, RIGHT, DOWN = (0.0, 0.0, 2.0), (4.0, 0.0, 0.0), (0.0, -4.0, 0.0)
CHECKERBOARD = backdrop_of([checkerboard(BEHIND, RIGHT, DOWN, 24)])

# Filters by the name that the dissertation gives them: ours, whether coefficients are computed, and λ.
FILTERS: dict[str, tuple[str, bool, float]] = {
    "central difference": ("central", True, 0.0),
    "trilinear, analytic": ("trilinear", True, 0.0),
    "Catmull-Rom": ("catmull-rom", True, 0.0),
    "B-spline 2": ("bspline2", True, 0.0),
    "B-spline 3": ("bspline3", True, 0.0),
    "B-spline 6": ("bspline6", True, 0.0),
    "B-spline 3, no prefilter": ("bspline3", False, 0.0),
    "B-spline 3, smooth λ = 1": ("bspline3", True, 1.0),
}


def ball(holes: int = 0) -> np.ndarray:
    """The Gaussian-fringe ball with up to two holes, in 8 bits; its surface lies at 127.5."""
    return eight_bit(sampled((FringeSphere(), ONE_HOLE, TWO_HOLES)[holes], NODES), 0.0, 1.0)


def breast() -> np.ndarray:
    """The speed of the 3-D breast phantom without skin in a liquid slower than fat, m/s, as a cube."""
    whole = table7(1400.0)
    parts = tuple(replace(part, speed_mps=1440.0) if part.name == "skin" else part for part in whole.parts)
    phantom = replace(whole, parts=parts)
    heights = np.linspace(-0.5, 0.5, NODES) * TABLE7_SIDE_M
    return np.stack([phantom.at(float(z)).speed(NODES, TABLE7_SIDE_M) for z in heights], axis=-1)


def glass(
    volume: np.ndarray,
    name: str,
    isos: Sequence[float] = (127.5,),
    indices: Sequence[float] = (1.0, INDEX),
) -> Scene:
    """A volume, read by one of ``FILTERS``, as glass of 2 along its longest edge."""
    kernel, prefilter, smoothing = FILTERS[name]
    spline = Spline.from_volume(volume, kernel, prefilter=prefilter, smoothing=smoothing, dtype=np.float32)
    return Scene.build(spline, Layers(tuple(isos), tuple(indices)), 2.0 / (max(volume.shape) - 1))


def drawn(
    scene: Scene,
    supersampling: str = "prss",
    backdrop: Backdrop = CHECKERBOARD,
    camera: Camera = FRONT,
    degree: int = 1,
    pixels: int = PIXELS,
    repeats: int = REPEATS,
) -> tuple[np.ndarray, float]:
    """A picture, and the least seconds that it took on one core in so many runs, once compiled."""
    how = RenderSettings(pixels, pixels, supersampling=supersampling, degree=degree, seed=None)
    render(scene, camera, backdrop, replace(how, rows=8, columns=8))
    seconds = []
    for _ in range(repeats):
        started = time.perf_counter()
        image = render(scene, camera, backdrop, how).image
        seconds.append(time.perf_counter() - started)
    return image, min(seconds)


def lit(scene: Scene, camera: Camera) -> np.ndarray:
    """The surface in Phong's model."""
    light = Light((-0.48, -0.36, 0.8), background=(255.0, 255.0, 255.0))
    return shade(scene, camera, light, PIXELS, PIXELS).image


def rings() -> np.ndarray:
    """The Marschner–Lobb signal on 40 nodes along each edge, as it was published."""
    return sampled(MarschnerLobb(), 40)


def slanted() -> Camera:
    """From above, at an angle."""
    return perspective((0.0, -2.6, 3.4), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 34.0)


def hills(pixels: int = 256) -> Plane:
    """A made landscape as a backdrop: sky, sun, three ridges."""
    across, down = np.meshgrid(np.linspace(0.0, 1.0, pixels), np.linspace(0.0, 1.0, pixels))
    image = np.stack([120 + 110 * down, 170 + 60 * down, 235 - 20 * down], axis=-1)
    image[np.hypot(across - 0.72, down - 0.25) < 0.07] = (255, 240, 180)
    for k, colour in enumerate(((110, 140, 120), (70, 110, 80), (45, 75, 50))):
        ridge = 0.5 + 0.14 * k + 0.06 * np.sin((5 + 3 * k) * across + 2 * k) + 0.02 * np.sin(31 * across + k)
        image[down > ridge] = colour
    return Plane(BEHIND, RIGHT, DOWN, image.astype(np.uint8))


def waves(nodes: int = 97) -> np.ndarray:
    """Heights of a wavy backdrop, a tenth of its edge."""
    u, v = np.meshgrid(np.linspace(-0.5, 0.5, nodes), np.linspace(-0.5, 0.5, nodes))
    return 0.2 * (1.0 - np.cos(4.0 * np.pi * u) * np.cos(4.0 * np.pi * v))

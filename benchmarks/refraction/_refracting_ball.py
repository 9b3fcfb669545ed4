"""The refracting ball of all renderers: exact end points of its rays, and errors."""

import numpy as np

from bentray_kernels.refraction import (
    Backdrop,
    Camera,
    Layers,
    Plane,
    Scene,
    backdrop_of,
    checkerboard,
    orthographic,
)
from bentray_kernels.splines import Spline

# In units of the distance between two nodes, about the middle of the volume.
NODES, PIXELS = 64, 256
WIDTH, CAMERA_Z, SCREEN_Z = 64.0, -60.0, 60.0
INDEX = 1.5

# Along each edge of the photograph behind the ball.
PHOTOGRAPH_PIXELS = 512

# Of the ball given as a signed distance.
DISTANCE_RADIUS = 22.0

# A ball of value 1 with a Gaussian fringe, rounded to 8 bits (dissertation, 4.4.1), and its surface.
FLAT, FRINGE = 14.0, 4.0
RIM_RADIUS = FLAT + FRINGE * float(np.sqrt(-2.0 * np.log(0.5)))

# Rays nearer to the rim than this bend so far that renderers part on whether they arrive at all.
WITHIN = 0.95

SQUARES = 16


def radii() -> np.ndarray:
    """(n, n, n) distances of the nodes from the middle."""
    axis = np.arange(NODES) - 0.5 * (NODES - 1)
    return np.sqrt(axis[:, None, None] ** 2 + axis[:, None] ** 2 + axis**2)


def signed_distance() -> np.ndarray:
    """Above 0 inside."""
    return DISTANCE_RADIUS - radii()


def eight_bit() -> np.ndarray:
    """Whole numbers from 0 to 255; the surface lies at 127.5."""
    return np.round(255.0 * np.exp(-0.5 * (np.maximum(radii() - FLAT, 0.0) / FRINGE) ** 2))


def ray_starts() -> np.ndarray:
    """(pixels², 2) x and y of the rays, rows of the image first."""
    middle = (np.arange(PIXELS) + 0.5) / PIXELS * WIDTH - 0.5 * WIDTH
    x, y = np.meshgrid(middle, middle)
    return np.stack([x.ravel(), y.ravel()], axis=1)


def camera() -> Camera:
    """Along z, the rows of the image in the order of y."""
    return orthographic((0.0, 0.0, CAMERA_Z), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0), WIDTH)


def board() -> Backdrop:
    """A checkerboard behind the ball."""
    return backdrop_of([checkerboard((0.0, 0.0, SCREEN_Z), (WIDTH, 0.0, 0.0), (0.0, WIDTH, 0.0), SQUARES)])


def photograph() -> Backdrop:
    """A picture with detail at every scale, as photographs have: random phases, amplitude 1 / frequency."""
    turns = np.fft.fftfreq(PHOTOGRAPH_PIXELS)
    frequency = np.hypot(turns[:, None], turns[None, :])
    frequency[0, 0] = np.inf
    noise = np.random.default_rng(0).standard_normal((3, PHOTOGRAPH_PIXELS, PHOTOGRAPH_PIXELS))
    texture = np.fft.ifft2(np.fft.fft2(noise) / frequency).real
    level = 127.5 + 50.0 * texture / texture.std(axis=(1, 2), keepdims=True)
    picture = np.clip(level, 0.0, 255.0).astype(np.uint8).transpose(1, 2, 0)
    edges = (WIDTH, 0.0, 0.0), (0.0, WIDTH, 0.0)
    return backdrop_of([Plane((0.0, 0.0, SCREEN_Z), *edges, np.ascontiguousarray(picture))])


def scene(spline: Spline, iso: float, bound: str = "bernstein") -> Scene:
    """The ball as Bentray sees it."""
    return Scene.build(spline, Layers((iso,), (1.0, INDEX)), bound=bound)


def exact(radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Which rays are compared, and where they end, (pixels², 2)."""
    start = ray_starts()
    offset = np.hypot(*start.T)
    compared = offset < WITHIN * radius
    sine = np.minimum(offset / radius, 1.0)
    incidence, within = np.arcsin(sine), np.arcsin(sine / INDEX)
    leaves = incidence + np.pi - 2.0 * within
    across, along = radius * np.sin(leaves), -radius * np.cos(leaves)
    ends = across - (SCREEN_Z - along) * np.tan(2.0 * (incidence - within))
    return compared, start * (ends / np.maximum(offset, 1e-12))[:, None]


def errors(points: np.ndarray, radius: float) -> np.ndarray:
    """How far from the exact places, nodes, the compared rays end; ``points`` is (pixels², 2), NaN: lost."""
    compared, ends = exact(radius)
    return np.linalg.norm(points - ends, axis=1)[compared]

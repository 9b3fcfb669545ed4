"""Volumes made here in place of the CT head and the lobster of chapter 4, which are not at hand.

They have the published sizes, 8 bits and noise, and thin parts, holes and layers as those have; what is
measured on them is not what was published.
"""

import numpy as np
from scipy.ndimage import gaussian_filter

from bentray_kernels.refraction import backdrop_of, checkerboard, orthographic

from ._refraction_ladders import Subject

# Grey levels: noise of a scanner, and the surface between air or resin and the body.
NOISE, ISO = 1.0, 45.0


def head() -> np.ndarray:
    """A head of skin, skull, brain and cavities: (128, 128, 128), x to the right, y to the back, z up."""
    x, y, z = np.meshgrid(*[np.linspace(-1.0, 1.0, 128)] * 3, indexing="ij", sparse=True)

    def ball(centre: tuple[float, ...], axes: tuple[float, ...]) -> np.ndarray:
        away = ((v - c) / a for v, c, a in zip((x, y, z), centre, axes, strict=True))
        return np.sqrt(sum(offset**2 for offset in away))

    cranium, jaw = ball((0.0, 0.08, 0.2), (0.6, 0.75, 0.62)), ball((0.0, -0.22, -0.42), (0.4, 0.42, 0.42))
    nose, neck = ball((0.0, -0.62, -0.12), (0.1, 0.16, 0.18)), np.hypot(x / 0.34, (y - 0.2) / 0.36) + 0.0 * z
    neck = np.where(z < -0.3, neck, 2.0)
    ears = np.minimum(*(ball((side * 0.61, 0.1, 0.02), (0.07, 0.14, 0.18)) for side in (-1.0, 1.0)))
    values = np.zeros((128, 128, 128))
    values[np.minimum.reduce([cranium, jaw, nose, neck, ears]) < 1.0] = 90.0
    values[(cranium < 0.9) | (jaw < 0.78)] = 220.0
    values[(cranium < 0.8) & (z > -0.25)] = 110.0
    values[(jaw < 0.62) & (z < -0.15)] = 95.0
    for side in (-1.0, 1.0):
        values[ball((side * 0.21, -0.45, 0.04), (0.13, 0.14, 0.12)) < 1.0] = 80.0
        values[ball((side * 0.07, -0.45, -0.14), (0.05, 0.14, 0.08)) < 1.0] = 0.0
    return _scanned(values, 0)


def lobster() -> np.ndarray:
    """A flat animal of a shell, claws and legs in resin: (320, 320, 34), z its thickness."""
    x, y = np.meshgrid(np.arange(320.0), np.arange(320.0), indexing="ij", sparse=True)
    outer = np.full((320, 320, 34), 9.0)
    z = np.arange(34.0) - 16.5

    def limb(points: list[tuple[float, float]], radii: list[float], thick: float) -> None:
        for (ax, ay), (bx, by), ra, rb in zip(points, points[1:], radii, radii[1:], strict=False):
            square = (bx - ax) ** 2 + (by - ay) ** 2
            t = np.clip(((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / square, 0.0, 1.0)
            flat = np.hypot(x - ax - t * (bx - ax), y - ay - t * (by - ay)) / (ra + t * (rb - ra))
            np.minimum(outer, np.sqrt(flat[..., None] ** 2 + (z / thick) ** 2), out=outer)

    limb([(160, 120), (160, 205)], [30.0, 24.0], 13.0)
    limb([(160, 205), (160, 285)], [22.0, 12.0], 10.0)
    for side in (-1.0, 1.0):
        limb([(160 + side * 24, 130), (160 + side * 75, 95), (160 + side * 85, 60)], [8.0, 9.0, 14.0], 9.0)
        limb([(160 + side * 85, 60), (160 + side * 70, 20)], [17.0, 5.0], 10.0)
        limb([(160 + side * 92, 60), (160 + side * 100, 24)], [9.0, 4.0], 8.0)
        for k in range(4):
            bend = (160 + side * (85 - 6 * k), 130 + 26 * k)
            limb(
                [(160 + side * 24, 140 + 17 * k), bend, (bend[0] + side * 24, bend[1] + 26)],
                [4.0, 3.5, 2.0],
                4.0,
            )
        limb([(160 + side * 8, 285), (160 + side * 24, 305)], [9.0, 8.0], 5.0)
        limb([(160 + side * 10, 92), (160 + side * 36, 8)], [2.5, 1.5], 3.0)
    values = np.where(outer < 1.0, 120.0, 12.0)
    values[outer < 0.75] = 75.0
    return _scanned(values, 1)


def _scanned(values: np.ndarray, seed: int) -> np.ndarray:
    """Blurred, with noise, in 8 bits."""
    noise = np.random.default_rng(seed).normal(0.0, NOISE, values.shape)
    return np.clip(np.rint(gaussian_filter(values, 0.7) + noise), 0.0, 255.0)


def stand_ins() -> list[Subject]:
    """Both, with the published figures of tables 2 to 4."""
    front = orthographic((0.0, -200.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), 150.0)
    behind = backdrop_of([checkerboard((0.0, 200.0, 0.0), (256.0, 0.0, 0.0), (0.0, 0.0, -256.0), 16)])
    above = orthographic((0.0, 0.0, -200.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), 340.0)
    below = backdrop_of([checkerboard((0.0, 0.0, 100.0), (512.0, 0.0, 0.0), (0.0, -512.0, 0.0), 32)])
    made = "made here in place of the published volume"
    return [
        Subject(
            "head, made here",
            made,
            head(),
            ISO,
            front,
            behind,
            {2: 0.752, 3: 0.523},
            (40.7, 8.89, 3.30, 4.57, 1.11),
            ((5.98, 7.50, 3.66, 4.57, 10.34), (0.56, 2.69, 1.00, 1.11, 1.91)),
        ),
        Subject(
            "lobster, made here",
            made,
            lobster(),
            ISO,
            above,
            below,
            {2: 0.623, 3: 0.606},
            (83.86, 14.62, 6.81, 8.25, 2.39),
            ((7.44, 12.46, 6.33, 8.25, 29.10), (1.48, 6.49, 2.32, 2.39, 4.07)),
        ),
    ]

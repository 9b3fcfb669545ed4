"""Measures of reflection images: where the brightest echo is, how wide it is, and the contrast of a cyst."""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import map_coordinates

from bentray_kernels.arrays import Floats
from bentray_kernels.tomography.result import Reflection

# Directions in which widths are measured, and steps of the profiles in a pixel.
DIRECTIONS, STEPS = 8, 20


class Echo(NamedTuple):
    """The brightest echo near a target: distance from it, and mean -6 dB width, m."""

    away_m: float
    width_m: float


def amplitude(image: Reflection) -> Floats:
    """Envelope relative to its maximum, (nx, ny)."""
    return np.asarray(10.0 ** (image.db / 20.0))


def echo_near(image: Reflection, point: tuple[float, float], window_m: float) -> Echo:
    """The brightest echo within a distance of a point.

    Args:
        image: 2-D.
        point: of the point, m.
        window_m: radius, m.
    """
    size = amplitude(image)
    x, y = axes_of(image)
    far = np.hypot(x - point[0], y - point[1]) > window_m
    i, j = np.unravel_index(np.argmax(np.where(far, 0.0, size)), size.shape)
    peak = _refined_peak(size, int(i), int(j))
    at = np.array(image.origin_m) + image.spacing_m[0] * peak
    widths = [_width(size, peak, np.pi * k / DIRECTIONS) for k in range(DIRECTIONS)]
    return Echo(float(np.hypot(*(at - point))), image.spacing_m[0] * float(np.mean(widths)))


def line_offset(image: Reflection, ends: tuple[tuple[float, float], ...], window_m: float) -> float:
    """Median distance across a line along x of the brightest echo at each of its pixels, m."""
    size = amplitude(image)
    (left, height), (right, _) = ends
    columns = np.arange(size.shape[0]) * image.spacing_m[0] + image.origin_m[0]
    rows = np.arange(size.shape[1]) * image.spacing_m[1] + image.origin_m[1]
    along = (columns >= left) & (columns <= right)
    near = np.abs(rows - height) <= window_m
    brightest = rows[near][size[np.ix_(along, near)].argmax(axis=1)]
    return float(np.median(np.abs(brightest - height)))


def cyst_contrast(image: Reflection, centre: tuple[float, float], radius_m: float) -> float:
    """Mean envelope in a ring around a cyst over that inside it."""
    size = amplitude(image)
    x, y = axes_of(image)
    away = np.hypot(x - centre[0], y - centre[1])
    outside = (away > 1.2 * radius_m) & (away < 1.7 * radius_m)
    return float(size[outside].mean() / size[away < 0.7 * radius_m].mean())


def axes_of(image: Reflection) -> tuple[Floats, Floats]:
    """x and y of the pixels, m, for broadcasting."""
    x, y = (image.origin_m[k] + image.spacing_m[k] * np.arange(image.db.shape[k]) for k in (0, 1))
    return x[:, None], y[None, :]


def _refined_peak(size: Floats, i: int, j: int) -> Floats:
    """The maximum of parabolas through a pixel and its neighbours, pixels."""
    peak = []
    for before, here, after, k in (
        (size[i - 1, j], size[i, j], size[i + 1, j], i),
        (size[i, j - 1], size[i, j], size[i, j + 1], j),
    ):
        bend = before - 2.0 * here + after
        peak.append(k + (0.5 * (before - after) / bend if bend < 0.0 else 0.0))
    return np.array(peak)


def _width(size: Floats, peak: Floats, turn: float) -> float:
    """Distance of the half maxima on both sides of a peak along a direction, pixels."""
    steps = np.arange(1, STEPS * max(size.shape)) / STEPS
    top = map_coordinates(size, peak[:, None], order=1)[0]
    width = 0.0
    for side in (1.0, -1.0):
        direction = side * np.array([np.cos(turn), np.sin(turn)])
        profile = map_coordinates(size, peak[:, None] + direction[:, None] * steps, order=1)
        below = np.flatnonzero(profile < 0.5 * top)
        width += steps[below[0]] if below.size else steps[-1]
    return width

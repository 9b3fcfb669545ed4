"""Volumes whose refraction is known exactly."""

import numpy as np

from bentray_kernels.arrays import Floats
from bentray_kernels.refraction import Layers, Scene, backdrop_of, checkerboard, orthographic
from bentray_kernels.splines import Spline

# A ball in the unit cube, seen along z before a chequered plane.
RADIUS = 0.3
CAMERA = orthographic((0.0, 0.0, -2.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0), 1.0)
BACKDROP = backdrop_of([checkerboard((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), 10)])


def glass_ball(nodes: int = 20, sign: float = 1.0) -> Scene:
    """A ball of index 1.5; of index 1 in glass if the sign is negative."""
    layers = Layers((sign * -(RADIUS**2),), (1.0, 1.5))
    return Scene.build(Spline(-sign * squared(nodes), prefilter=False), layers, 1.0 / (nodes - 1))


def squared(n: int) -> Floats:
    """Squared distance from the middle of n³ nodes over the unit cube, as coefficients of the cubic B-spline.

    The cubic B-spline makes x² + h²/3 of the coefficients x² (h the spacing), so it is exact.
    """
    axis = np.linspace(-0.5, 0.5, n)
    third = (axis[1] - axis[0]) ** 2 / 3.0
    return (axis[:, None, None] ** 2 + axis[:, None] ** 2 + axis**2) - 3.0 * third


def distance(n: int) -> Floats:
    """Distance from the middle of n³ nodes over the unit cube."""
    axis = np.linspace(-0.5, 0.5, n)
    return np.sqrt(axis[:, None, None] ** 2 + axis[:, None] ** 2 + axis**2)


def through_ball(offset: Floats, radius: float, index: float, screen: float) -> tuple[Floats, Floats]:
    """Rays parallel to an axis through a ball: how far from it they meet a screen, and their deflection, rad.

    Args:
        offset: (n,) distances of the rays from the axis, below ``radius``.
        radius: of the ball.
        index: its refractive index over that of the surroundings.
        screen: distance of the screen behind the middle.
    """
    incidence = np.arcsin(offset / radius)
    within = np.arcsin(offset / radius / index)
    deflection = 2.0 * (incidence - within)
    leaves = incidence + np.pi - 2.0 * within
    across, along = radius * np.sin(leaves), -radius * np.cos(leaves)
    return across - (screen - along) * np.tan(deflection), deflection

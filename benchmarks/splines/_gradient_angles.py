"""Figures 5 and 6: the angle between a filter's gradient and the true one along a circle."""

from collections.abc import Callable

import numpy as np

from bentray_kernels.phantoms import CubeField, FringeSphere, MarschnerLobb, eight_bit, in_nodes, sampled
from bentray_kernels.splines import Spline, smoothing_for_noise
from bentray_kernels.splines.smoothing import ROUNDING

# One point for every two degrees (dissertation, 3.4.1).
ANGLES = np.deg2rad(np.arange(0.0, 360.0, 2.0))

PREFILTERED = ("central", "trilinear", "catmull-rom", *(f"bspline{order}" for order in range(2, 7)))

# The dissertation does not say how it sampled. With 50 nodes a side and a circle of radius 0.7 about the z
# axis at z = 0, Catmull-Rom and the quadratic B-spline come out at its 6.10° and 3.69°.
RINGS_NODES, RINGS_RADIUS = 50, 0.7

# 64³ is given (4.4.1), the ball's size is not; its edge is read at half its value.
BALL_NODES, BALL_ISO = 64, 0.5

Made = Callable[[np.ndarray], Spline]


def rings() -> dict[str, float]:
    """Mean angle by filter on the Marschner-Lobb signal, degrees; figure 6."""
    field = MarschnerLobb()
    volume = sampled(field, RINGS_NODES)
    points = circle(RINGS_RADIUS)
    angles = {name: mean_angle(field, Spline.from_volume(volume, name), points) for name in PREFILTERED}
    angles["half-node differences"] = half_node_differences(field, volume, points)
    return angles


def ball() -> dict[str, float]:
    """Mean angle by filter on the 8-bit ball with a Gaussian fringe, degrees; figure 5."""
    field = FringeSphere()
    volume = eight_bit(sampled(field, BALL_NODES), 0.0, 1.0)
    points = circle(field.iso_radius(BALL_ISO))
    made: dict[str, Spline] = {name: Spline.from_volume(volume, name) for name in PREFILTERED}
    made |= {f"raw {order}": Spline(volume, order, prefilter=False) for order in range(2, 7)}
    made["smooth 1"] = Spline(volume, 3, smoothing=1.0)
    made["smooth noise"] = Spline(volume, 3, smoothing=smoothing_for_noise(volume, 3, ROUNDING))
    return {name: mean_angle(field, spline, points) for name, spline in made.items()}


def circle(radius: float) -> np.ndarray:
    """(180, 3) points about the z axis in the plane z = 0 of the cube."""
    return np.column_stack((radius * np.cos(ANGLES), radius * np.sin(ANGLES), np.zeros(len(ANGLES))))


def mean_angle(field: CubeField, spline: Spline, points: np.ndarray) -> float:
    """Between the spline's gradient and the field's, degrees."""
    return between(spline.gradient(in_nodes(points, spline.shape[0])), field.gradient(points))


def half_node_differences(field: CubeField, volume: np.ndarray, points: np.ndarray) -> float:
    """Another reading of central differences: of trilinear values half a node away, in the plane."""
    linear, nodes = Spline.from_volume(volume, "trilinear"), in_nodes(points, volume.shape[0])
    steps = 0.5 * np.eye(3)[:2]
    slopes = np.stack([linear.value(nodes + step) - linear.value(nodes - step) for step in steps], axis=1)
    return between(slopes, field.gradient(points)[:, :2])


def between(slope: np.ndarray, true: np.ndarray) -> float:
    """Mean angle of vectors, degrees."""
    cosines = (slope * true).sum(axis=1) / np.linalg.norm(slope, axis=1) / np.linalg.norm(true, axis=1)
    return float(np.rad2deg(np.arccos(np.clip(cosines, -1.0, 1.0))).mean())

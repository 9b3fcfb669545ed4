"""Roots of the field along a ray: Brent's method, and the cubic of a trilinear cell."""

import math
from typing import NamedTuple

import numpy as np

from ..arrays import Vector
from ..compilation.compiled import kernel
from ..splines.sampler import Sampler, sampled_value, sampled_value_and_gradient

# Steps of either method; both halve what is left at worst every third.
STEPS = 200


class Ray(NamedTuple):
    """The points origin + s·direction, in nodes; s is in the unit in which direction is nodes per unit.

    Attributes:
        x, y, z: origin.
        along_x, along_y, along_z: direction.
        over_x, over_y, over_z: one over the direction; ±infinity where it is 0.
    """

    x: float
    y: float
    z: float
    along_x: float
    along_y: float
    along_z: float
    over_x: float
    over_y: float
    over_z: float


@kernel(inline="always")
def ray_of(origin: tuple[float, float, float], along: tuple[float, float, float]) -> Ray:
    """The ray from an origin, nodes."""
    over = (1.0 / along[0], 1.0 / along[1], 1.0 / along[2])
    return Ray(*origin, *along, *over)


@kernel(inline="always")
def point_at(ray: Ray, s: float) -> tuple[float, float, float]:
    """The point at s, nodes."""
    return ray.x + s * ray.along_x, ray.y + s * ray.along_y, ray.z + s * ray.along_z


@kernel(inline="always")
def field_at(field: Sampler, ray: Ray, s: float) -> float:
    """The field at s."""
    return sampled_value(field, point_at(ray, s))


@kernel(inline="always")
def brent(
    field: Sampler,
    ray: Ray,
    target: float,
    a: float,
    value_a: float,
    b: float,
    value_b: float,
    tolerance: float,
) -> float:
    """Where the field is ``target`` between a and b, by Brent's method (1973, chapter 4).

    Args:
        field: what is read.
        ray: along which.
        target: the value.
        a, b: ends, between whose values ``target`` lies.
        value_a, value_b: the field there.
        tolerance: of s; also reached where the field is as close to ``target`` as the chord is over it.
    """
    f_a, f_b = value_a - target, value_b - target
    if f_a == 0.0:
        return a
    close = tolerance * abs(f_b - f_a) / abs(b - a)
    c, f_c = a, f_a
    step = last = b - a
    for _ in range(STEPS):
        if (f_b > 0.0) == (f_c > 0.0):
            c, f_c = a, f_a
            step = last = b - a
        if abs(f_c) < abs(f_b):
            a, b, c = b, c, b
            f_a, f_b, f_c = f_b, f_c, f_b
        half = 0.5 * (c - b)
        if abs(half) <= tolerance or abs(f_b) <= close:
            break
        if abs(last) >= tolerance and abs(f_a) > abs(f_b):
            ratio = f_b / f_a
            if a == c:
                p, q = 2.0 * half * ratio, 1.0 - ratio
            else:
                u, v = f_a / f_c, f_b / f_c
                p = ratio * (2.0 * half * u * (u - v) - (b - a) * (v - 1.0))
                q = (u - 1.0) * (v - 1.0) * (ratio - 1.0)
            q = -q if p > 0.0 else q
            p = abs(p)
            if 2.0 * p < min(3.0 * half * q - abs(tolerance * q), abs(last * q)):
                last, step = step, p / q
            else:
                last = step = half
        else:
            last = step = half
        a, f_a = b, f_b
        b += step if abs(step) > tolerance else math.copysign(tolerance, half)
        f_b = field_at(field, ray, b) - target
    return b


@kernel(inline="always")
def newton(
    field: Sampler,
    ray: Ray,
    target: float,
    a: float,
    value_a: float,
    b: float,
    value_b: float,
    bend: float,
    tolerance: float,
) -> tuple[float, Vector]:
    """Where the field is ``target`` between a and b, and its gradient there, by Newton's method.

    The field is monotone from a to b and its second derivative at most ``bend``, so a step leaves an error of
    at most bend·step²/2 over the slope. The gradient is carried on to the root along the last two readings.

    Args:
        field, ray, target, a, value_a, b, value_b: as for ``brent``.
        bend: upper bound of the second derivative along the ray.
        tolerance: of s.

    Returns:
        s and the gradient, per node.
    """
    s = a + (b - a) * (target - value_a) / (value_b - value_a)
    gradient, last = (0.0, 0.0, 0.0), 0.0
    for count in range(STEPS):
        before = gradient
        value, gradient = sampled_value_and_gradient(field, point_at(ray, s))
        slope = gradient[0] * ray.along_x + gradient[1] * ray.along_y + gradient[2] * ray.along_z
        if (value > target) == (value_b > value_a):
            b = s
        else:
            a = s
        step = (target - value) / slope
        if not a <= s + step <= b:
            # Out of the bracket, or no slope to follow.
            step = 0.5 * (a + b) - s
        elif abs(step) <= tolerance:
            return s + step, gradient
        elif count > 0 and 0.5 * bend * step * step <= tolerance * abs(slope):
            on = step / last
            x = gradient[0] + on * (gradient[0] - before[0])
            y = gradient[1] + on * (gradient[1] - before[1])
            z = gradient[2] + on * (gradient[2] - before[2])
            return s + step, (x, y, z)
        last = step
        s += step
    return s, gradient


@kernel(inline="always")
def first_root_of_cubic(c0: float, c1: float, c2: float, c3: float) -> float:
    """The least root in 0 ≤ t ≤ 1 of c0 + c1·t + c2·t² + c3·t³, or infinity.

    Along a ray a trilinear cell is such a cubic (Parker et al. 1998, after Schwarze 1990). Roots are taken by
    the trigonometric formula, and a Newton step removes what cancellation leaves.
    """
    scale = max(abs(c0), abs(c1), abs(c2), abs(c3))
    first = np.inf
    if abs(c3) > 1e-9 * scale:
        p, q = c2 / (3.0 * c3), c1 / c3
        third = (q - 3.0 * p * p) / 3.0
        constant = (2.0 * p * p - q) * p + c0 / c3
        discriminant = 0.25 * constant * constant + third**3
        if discriminant > 0.0:
            root = math.sqrt(discriminant)
            larger = np.cbrt(-0.5 * constant - math.copysign(root, constant))
            first = _polished(larger - third / larger - p, c0, c1, c2, c3)
        else:
            radius = math.sqrt(-third)
            cosine = -0.5 * constant / radius**3 if radius > 0.0 else 0.0
            angle = math.acos(min(max(cosine, -1.0), 1.0)) / 3.0
            for k in range(3):
                t = 2.0 * radius * math.cos(angle + k * (2.0 * math.pi / 3.0)) - p
                first = min(first, _polished(t, c0, c1, c2, c3))
    elif abs(c2) > 1e-12 * scale:
        discriminant = c1 * c1 - 4.0 * c2 * c0
        if discriminant >= 0.0:
            both = -0.5 * (c1 + math.copysign(math.sqrt(discriminant), c1))
            first = _polished(both / c2, c0, c1, c2, c3)
            if both != 0.0:
                first = min(first, _polished(c0 / both, c0, c1, c2, c3))
    elif c1 != 0.0:
        first = _polished(-c0 / c1, c0, c1, c2, c3)
    return first


@kernel(inline="always")
def _polished(t: float, c0: float, c1: float, c2: float, c3: float) -> float:
    """A root after two Newton steps; infinity outside the cell."""
    for _ in range(2):
        slope = c1 + t * (2.0 * c2 + t * 3.0 * c3)
        if slope != 0.0:
            t -= (c0 + t * (c1 + t * (c2 + t * c3))) / slope
    return t if -1e-12 <= t <= 1.0 + 1e-12 else np.inf

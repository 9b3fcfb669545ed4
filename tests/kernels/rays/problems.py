"""Media of rays: a constant gradient, whose times are known, and speeds without any smoothness."""

import numpy as np


def gradient_speed(n, ndim=2):
    """Speed 1 + 4x at the nodes of the unit cube."""
    along = np.linspace(0.0, 1.0, n).reshape((n,) + (1,) * (ndim - 1))
    return 1.0 + 4.0 * np.broadcast_to(along, (n,) * ndim)


def gradient_times(points, source):
    """Exact times through it."""
    squared = ((points - source) ** 2).sum(axis=-1)
    return np.arccosh(1.0 + 8.0 * squared / ((1.0 + 4.0 * source[0]) * (1.0 + 4.0 * points[..., 0]))) / 4.0


def rough_problem(seed, flat, low, high):
    """Speeds, a source and six receivers anywhere, at a spacing of 1."""
    rng = np.random.default_rng(seed)
    shape = (14, 17) if flat else (7, 8, 6)
    last = np.array(shape) - 1.0
    return rng.uniform(low, high, shape), rng.random(len(shape)) * last, rng.random((6, len(shape))) * last

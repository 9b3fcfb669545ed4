"""Echoes of points in homogeneous water with a known pulse: the exact signals of a ring of elements."""

import numpy as np

WATER, CENTRE_HZ, RATE_HZ, RADIUS = 1500.0, 5e5, 4e6, 0.03
T0 = -4e-6


def ring(count=24, radius=RADIUS):
    """Elements about the origin, (count, 2), m."""
    angle = 2.0 * np.pi * np.arange(count) / count + 0.05
    return radius * np.column_stack((np.cos(angle), np.sin(angle)))


def pulse(late_s):
    """A Gaussian pulse with its maximum at 0."""
    late = late_s * CENTRE_HZ
    return np.exp(-((0.9 * late) ** 2)) * np.cos(2.0 * np.pi * late)


def traces(elements, points, samples=400, delay_s=0.0, transmitted=0.0):
    """Traces of all pairs, (k, k, samples): an echo of each point and, if any, the transmitted wave."""
    time = T0 + np.arange(samples) / RATE_HZ
    result = np.zeros((len(elements), len(elements), samples))
    for point in points:
        way = np.linalg.norm(elements - point, axis=1) / WATER
        result += pulse(time - delay_s - (way[:, None] + way[None, :])[..., None])
    direct = np.linalg.norm(elements[:, None] - elements[None], axis=-1) / WATER
    return result + transmitted * pulse(time - delay_s - direct[..., None])

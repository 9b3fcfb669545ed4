"""Shapes of simulated arrays other than whole rings: arcs, facing lines and bowls, with directions."""

import math
from typing import NamedTuple

import numpy as np

from ...arrays import Floats


class Elements(NamedTuple):
    """Elements of an array.

    Attributes:
        position_m: (elements, 2 or 3), m.
        normal: as ``position_m``, unit directions towards the object.
    """

    position_m: Floats
    normal: Floats


def arc(elements: int, radius_m: float, degrees: float = 360.0) -> Elements:
    """Equally spaced elements on a part of a circle around 0, from the x axis anticlockwise.

    Args:
        elements: their number; on a whole circle the last one lies before the first.
        radius_m: of the circle, m.
        degrees: of the arc.
    """
    whole = degrees >= 360.0
    angle = np.linspace(0.0, math.radians(min(degrees, 360.0)), elements, endpoint=not whole)
    outward = np.column_stack((np.cos(angle), np.sin(angle)))
    return Elements(radius_m * outward, -outward)


def facing_lines(elements: int, length_m: float, gap_m: float) -> Elements:
    """Two parallel lines along y, on both sides of 0, the one at x < 0 first.

    Args:
        elements: of each line.
        length_m: of each line, m.
        gap_m: between them, m.
    """
    y = np.linspace(-0.5 * length_m, 0.5 * length_m, elements)
    position = np.concatenate(
        [np.column_stack((np.full(elements, x), y)) for x in (-0.5 * gap_m, 0.5 * gap_m)]
    )
    inward = np.repeat([[1.0, 0.0], [-1.0, 0.0]], elements, axis=0)
    return Elements(position, inward)


def bowl(elements: int, radius_m: float) -> Elements:
    """Elements spread evenly, on a spiral, over the half of a sphere around 0 below z = 0."""
    depth = (np.arange(elements) + 0.5) / elements
    angle = math.pi * (1.0 + math.sqrt(5.0)) * np.arange(elements)
    across = np.sqrt(1.0 - depth**2)
    outward = np.column_stack((across * np.cos(angle), across * np.sin(angle), -depth))
    return Elements(radius_m * outward, -outward)

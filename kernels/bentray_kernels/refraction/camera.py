"""Cameras: the ray of each position in the image."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Vector
from ..compilation.compiled import kernel
from ..errors import InvalidInput


@dataclass(frozen=True)
class Camera:
    """Origins and directions of rays; x runs along the rows of the image, y down its columns.

    The coordinates u and v of the image run from −½ to ½, across and down. A ray starts at origin[0] +
    u·origin[1] + v·origin[2] in the direction direction[0] + u·direction[1] + v·direction[2].

    Attributes:
        origin: (3, 3), m.
        direction: (3, 3), any length.
    """

    origin: Floats
    direction: Floats


@kernel(inline="always")
def affine(basis: Floats, u: float, v: float) -> Vector:
    """basis[0] + u·basis[1] + v·basis[2], the origin or direction of a ray; ``basis`` as in ``Camera``."""
    return (
        basis[0, 0] + u * basis[1, 0] + v * basis[2, 0],
        basis[0, 1] + u * basis[1, 1] + v * basis[2, 1],
        basis[0, 2] + u * basis[1, 2] + v * basis[2, 2],
    )


@kernel(inline="always")
def ray_at(camera: tuple[Floats, Floats], u: float, v: float) -> tuple[Vector, Vector]:
    """Origin and unit direction of a ray; ``camera`` as ``Camera.origin`` and ``Camera.direction``."""
    ahead = affine(camera[1], u, v)
    length = math.sqrt(ahead[0] ** 2 + ahead[1] ** 2 + ahead[2] ** 2)
    return affine(camera[0], u, v), (ahead[0] / length, ahead[1] / length, ahead[2] / length)


def orthographic(
    centre: ArrayLike, forward: ArrayLike, up: ArrayLike, width_m: float, aspect: float = 1.0
) -> Camera:
    """Parallel rays through a rectangle.

    Args:
        centre: (3,) middle of the rectangle, before the object, m.
        forward: (3,) direction of all rays, any length.
        up: (3,) direction that is up in the image.
        width_m: of the rectangle, m.
        aspect: its height over its width.

    Raises:
        InvalidInput: for a width that is not above 0, or ``up`` along ``forward``.
    """
    ahead, right, down = _frame(forward, up)
    _check_positive("width_m", width_m)
    _check_positive("aspect", aspect)
    middle = np.asarray(centre, dtype=np.float64)
    origin = np.array([middle, right * width_m, down * width_m * aspect])
    return Camera(origin, np.array([ahead, np.zeros(3), np.zeros(3)]))


def perspective(
    eye: ArrayLike, target: ArrayLike, up: ArrayLike, view_deg: float, aspect: float = 1.0
) -> Camera:
    """Rays from one point.

    Args:
        eye: (3,) that point, m.
        target: (3,) what is in the middle of the image, m.
        up: (3,) direction that is up in the image.
        view_deg: angle across the width of the image, degrees.
        aspect: height of the image over its width.

    Raises:
        InvalidInput: for an angle not between 0 and 180, or ``up`` along the view.
    """
    start = np.asarray(eye, dtype=np.float64)
    ahead, right, down = _frame(np.asarray(target, dtype=np.float64) - start, up)
    if not 0.0 < view_deg < 180.0:
        raise InvalidInput("view_deg", view_deg, "an angle between 0 and 180 degrees")
    _check_positive("aspect", aspect)
    width = 2.0 * math.tan(math.radians(0.5 * view_deg))
    origin = np.array([start, np.zeros(3), np.zeros(3)])
    return Camera(origin, np.array([ahead, right * width, down * width * aspect]))


def _frame(forward: ArrayLike, up: ArrayLike) -> tuple[Floats, Floats, Floats]:
    ahead = np.asarray(forward, dtype=np.float64)
    right = np.cross(ahead, np.asarray(up, dtype=np.float64))
    if not np.linalg.norm(right) > 1e-9 * np.linalg.norm(ahead):
        raise InvalidInput("up", np.asarray(up).tolist(), "a direction that is not along the view")
    ahead, right = ahead / np.linalg.norm(ahead), right / np.linalg.norm(right)
    return ahead, right, np.cross(ahead, right)


def _check_positive(field: str, value: float) -> None:
    if not 0.0 < value < math.inf:
        raise InvalidInput(field, value, "a finite number > 0")

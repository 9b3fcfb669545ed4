"""Samples of the unit cube's surface, which index the lines through it, and its intersection with rays.

Face k = 2a + b is the one across axis a at coordinate b; its x and y are the two other axes in their order.
Each face has n² samples at the middles of its squares. A sample (x, y) of face k is in a rectangle of
6n × n at x₀ = x + kn, x₁ = y, and has the number 6n·x₁ + x₀ (dissertation, section 5.3.3, figure 24).
"""

import numpy as np

from ...arrays import Floats
from ...compilation.compiled import kernel
from ...compilation.float32 import higher, lower, real, whole
from ...errors import InvalidInput
from ...requests.rendering_limits import MAX_SAMPLES

# Replaces a 0 of a direction: its reciprocal is finite in float32, and so are products with it.
ALMOST_ZERO = real(1e-18)
# How far outside the cube its faces are for rays, so that one that runs along a face is inside.
MARGIN = real(1e-7)

# Near and far distance along the ray; then face, x and y of the entry, and of the exit.
Line = tuple[float, float, int, float, float, int, float, float]


def check_samples(n: int) -> None:
    """Raise for a number of samples along an edge that no table has.

    Raises:
        InvalidInput: for one not between 2 and 48.
    """
    if not 2 <= n <= MAX_SAMPLES:
        raise InvalidInput("samples", n, f"2 to {MAX_SAMPLES} along an edge of the cube")


def samples(n: int) -> Floats:
    """Places of the samples, (6n², 3) in the order of their numbers, edges of the cube.

    Args:
        n: samples along an edge.

    Raises:
        InvalidInput: as ``check_samples``.
    """
    check_samples(n)
    middle = (np.arange(n) + 0.5) / n
    points = np.empty((n, 6, n, 3))
    for face in range(6):
        axis, side = divmod(face, 2)
        first, second = (other for other in range(3) if other != axis)
        points[:, face, :, axis] = side
        points[:, face, :, first] = middle[None, :]
        points[:, face, :, second] = middle[:, None]
    return points.reshape(-1, 3)


@kernel(inline="always")
def _not_zero(a: float) -> float:
    return a if abs(a) > ALMOST_ZERO else ALMOST_ZERO


@kernel(inline="always")
def line_of(ox: float, oy: float, oz: float, dx: float, dy: float, dz: float) -> Line:
    """Where a ray's line enters and leaves the unit cube; without branches, so that loops are vectorised.

    Args:
        ox, oy, oz: a point of the line, edges of the cube; inside or outside it.
        dx, dy, dz: its direction, any length.

    Returns:
        Distances of entry and exit in lengths of the direction, the first below the second where the line
        meets the cube; face, x and y in [0, 1] of the entry; the same of the exit.
    """
    dx, dy, dz = _not_zero(dx), _not_zero(dy), _not_zero(dz)
    zero, one = real(0.0), real(1.0)
    ix, iy, iz = one / dx, one / dy, one / dz
    low, high = -MARGIN, one + MARGIN
    ax, bx = (low - ox) * ix, (high - ox) * ix
    ay, by = (low - oy) * iy, (high - oy) * iy
    az, bz = (low - oz) * iz, (high - oz) * iz
    near_x, near_y, near_z = lower(ax, bx), lower(ay, by), lower(az, bz)
    far_x, far_y, far_z = higher(ax, bx), higher(ay, by), higher(az, bz)
    near = higher(higher(near_x, near_y), near_z)
    far = lower(lower(far_x, far_y), far_z)
    into = whole(0) if near_x == near else (whole(1) if near_y == near else whole(2))
    out = whole(0) if far_x == far else (whole(1) if far_y == far else whole(2))
    along_into = dx if into == 0 else (dy if into == 1 else dz)
    along_out = dx if out == 0 else (dy if out == 1 else dz)
    face_into = whole(2) * into + (whole(0) if along_into > zero else whole(1))
    face_out = whole(2) * out + (whole(1) if along_out > zero else whole(0))
    sx, sy, sz = ox + near * dx, oy + near * dy, oz + near * dz
    tx, ty, tz = ox + far * dx, oy + far * dy, oz + far * dz
    return (
        near,
        far,
        face_into,
        sy if into == 0 else sx,
        sy if into == 2 else sz,
        face_out,
        ty if out == 0 else tx,
        ty if out == 2 else tz,
    )


@kernel(inline="always")
def number_at(face: int, x: float, y: float, n: int) -> int:
    """Number of the sample nearest to a place (x, y) in [0, 1] of a face."""
    # In floats, which hold it exactly: vectors multiply whole numbers slowly.
    zero, count, last = real(0.0), real(n), real(n - 1)
    i = real(whole(lower(higher(x * count, zero), last)))
    j = real(whole(lower(higher(y * count, zero), last)))
    number: int = whole(real(6.0) * count * j + i + real(face) * count)
    return number

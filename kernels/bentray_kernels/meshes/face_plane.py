"""Intersection of a ray with the plane of a face, and the neighbour on the side of the point."""

from ..arrays import Float32s, Int32s
from ..compilation.compiled import kernel
from ..compilation.float32 import lower, real

# Distance, in lengths of the direction; weights of the corners 0, 1 and 2; the determinant, above 0 where the
# outside of the face is seen.
Meeting = tuple[float, float, float, float, float]


@kernel(inline="always")
def meet_plane(
    triangles: Float32s, face: int, sx: float, sy: float, sz: float, dx: float, dy: float, dz: float
) -> Meeting:
    """Where a line meets the plane of a face (Möller and Trumbore, 1997), in the precision of its arguments.

    Args:
        triangles: ``Surface.triangles``.
        face: one of its rows.
        sx, sy, sz: a point of the line near the face, edges of the cube.
        dx, dy, dz: its direction.
    """
    ax, ay, az = triangles[face, 0], triangles[face, 1], triangles[face, 2]
    px, py, pz = triangles[face, 3] - ax, triangles[face, 4] - ay, triangles[face, 5] - az
    qx, qy, qz = triangles[face, 6] - ax, triangles[face, 7] - ay, triangles[face, 8] - az
    rx, ry, rz = sx - ax, sy - ay, sz - az
    nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
    determinant = -(dx * nx + dy * ny + dz * nz)
    over = real(1.0) / determinant
    mx, my, mz = ry * dz - rz * dy, rz * dx - rx * dz, rx * dy - ry * dx
    distance = (rx * nx + ry * ny + rz * nz) * over
    first = (qx * mx + qy * my + qz * mz) * over
    second = -(px * mx + py * my + pz * mz) * over
    return distance, real(1.0) - first - second, first, second, determinant


@kernel(inline="always")
def beyond(links: Int32s, face: int, first: float, second: float, third: float, slack: float) -> int:
    """The face across the edge that a point of the plane lies farthest behind; behind none, itself.

    Args:
        links: ``Surface.links``.
        face: one of its rows.
        first, second, third: weights of the point's corners 0, 1 and 2.
        slack: how far below 0 a weight still counts as inside.
    """
    least = lower(first, lower(second, third))
    if least >= -slack:
        return face
    at = 9 if least == third else (10 if least == first else 11)
    across: int = links[face, at]
    return across

"""Reference lookup of the dissertation for rays that leave the surface: an inner field of (u, v).

Section 5.2.2 names such a ray by the two points (s, t) of the surface between which it runs, and looks up
the entry closest to s. As t is what is sought, the entry is found by s and the sample of the cube by which
the ray's line leaves it, as in ``InnerField``. It holds the (u, v) of t and nothing else: there is no walk,
so the ray ends where the one from the point closest to s ends.
"""

import numpy as np

from ...arrays import Float32s, Floats, Int32s
from ...compilation.compiled import kernel
from ...compilation.float32 import higher, lower, real
from ...errors import InvalidInput
from ...meshes.face_plane import meet_plane
from ...meshes.surface import Surface
from .cube import samples
from .inner_field import InnerField
from .quadrilinear import corner_of

Places = Floats | Float32s

# 512 MB.
MAX_INNER_ENTRIES = 2**26


def inner_uv_table(surface: Surface, field: InnerField, points: Int32s) -> Float32s:
    """The (u, v) of every entry, (points, 6n², 2) float32; NaN where its ray meets nothing.

    Args:
        surface: ``surface_of``.
        field: its inner field, whose entries are the faces of the same hits.
        points: (points,) of ``spread_points``: the faces from whose middles its rays start.

    Raises:
        InvalidInput: for points of another field, and for more than ``MAX_INNER_ENTRIES`` entries.
    """
    if points.shape != (len(field.faces),):
        raise InvalidInput("points", f"shape {points.shape}", f"({len(field.faces)},), a point a row")
    if field.faces.size > MAX_INNER_ENTRIES:
        accepted = f"at most {MAX_INNER_ENTRIES} entries of the inner field, for lookups of (u, v)"
        raise InvalidInput("divisions", f"{field.faces.size} entries", accepted)
    corners = surface.triangles[points]
    starts = (corners[:, :3] + corners[:, 3:6] + corners[:, 6:9]).astype(np.float64) / 3.0
    return uv_at_ends(surface, field.faces, starts, samples(field.samples))


def uv_at_ends(
    surface: Surface, faces: Int32s, starts: Floats | Float32s, exits: Floats | Float32s
) -> Float32s:
    """The (u, v) where rays meet faces, (starts, exits, 2) float32; NaN where a ray meets none.

    Args:
        surface: ``surface_of``.
        faces: (starts, exits) rows of its triangles, below 0 for none.
        starts, exits: (starts, 3) and (exits, 3) between which the rays run, edges of the cube; in their
            precision everything is computed.
    """
    table = np.empty((*faces.shape, 2), dtype=np.float32)
    _fill_uv(surface, faces, starts, exits, table)
    return table


@kernel
def _fill_uv(surface: Surface, faces: Int32s, starts: Places, exits: Places, table: Float32s) -> None:
    for i in range(len(starts)):
        sx, sy, sz = starts[i, 0], starts[i, 1], starts[i, 2]
        for j in range(len(exits)):
            face = faces[i, j]
            if face < 0:
                table[i, j] = np.nan
                continue
            dx, dy, dz = exits[j, 0] - sx, exits[j, 1] - sy, exits[j, 2] - sz
            _, first, second, third, _ = meet_plane(surface.triangles, face, sx, sy, sz, dx, dy, dz)
            for c in range(2):
                corners = surface.uv[face, 0, c], surface.uv[face, 1, c], surface.uv[face, 2, c]
                inside = first * corners[0] + second * corners[1] + third * corners[2]
                table[i, j, c] = lower(higher(inside, real(0.0)), real(1.0))


@kernel(inline="always")
def linear_exit_uv(row: Float32s, n: int, face: int, x: float, y: float) -> tuple[float, float]:
    """The (u, v) averaged over the four exits about the one of a ray that meets something.

    Exits whose rays meet nothing are left out.

    Args:
        row: entries of a point, in one dimension.
        n: samples along an edge of the cube.
        face, x, y: where the ray leaves the cube, see ``cube.line_of``; the nearest exit has a (u, v).
    """
    at, _, _, right, down = corner_of(n, 0, real(0.0), real(0.0), face, x, y)
    u, v, total = real(0.0), real(0.0), real(0.0)
    for m in range(2):
        for p in range(2):
            weight = (right if m else real(1.0) - right) * (down if p else real(1.0) - down)
            place = 2 * (at + 6 * n * p + m)
            # NaN is not equal to itself.
            if row[place] == row[place]:
                u, v = u + weight * row[place], v + weight * row[place + 1]
                total += weight
    return u / total, v / total

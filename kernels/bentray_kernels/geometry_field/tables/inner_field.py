"""The inner geometry field: the first hit of rays that leave the surface, to its inside or outside.

Dissertation, section 5.2.2, names such a ray by the two points (s, t) of the surface between which it runs;
but t is what is sought. Here s is one of the points spread over the surface, and t the sample of the cube by
which the ray's line leaves the cube. So both ends are known before the look-up, rays to the inside, of
refraction, and to the outside, of self-reflection, are one table, and its columns are those of the outer
field. To hold t rather than the direction lets far hits stay put when s moves to the nearest point. The face
alone is kept: from there the ray itself walks, since where it starts on the surface no error is small.
"""

from typing import NamedTuple

import numpy as np

from ...arrays import Floats, Int32s
from ...compilation.compiled import int64, kernel
from ...errors import InvalidInput
from ...meshes.intersector import WAITING, closest
from ...meshes.surface import Surface
from .cube import check_samples, samples


class InnerField(NamedTuple):
    """The table.

    Attributes:
        samples: n along an edge of the cube.
        starts: (surface faces,) int32: the point from which rays that leave a face are taken to start.
        faces: (points, 6n²) int32 by point and exit: rows of ``Surface.triangles``, −1 for none.
    """

    samples: int
    starts: Int32s
    faces: Int32s


def spread_points(surface: Surface, divisions: int) -> tuple[Int32s, Int32s]:
    """Faces whose centres represent the surface: one for each side of it in each small cube.

    Args:
        surface: ``surface_of``.
        divisions: small cubes along an edge of the unit cube.

    Returns:
        The chosen faces, (points,); for each face of the surface its point, (faces,).

    Raises:
        InvalidInput: for no divisions, or more than 256.
    """
    if not 1 <= divisions <= 256:
        raise InvalidInput("divisions", divisions, "1 to 256 along an edge of the cube")
    corners = surface.triangles[:, :9].reshape(-1, 3, 3).astype(np.float64)
    middles = corners.mean(axis=1)
    cell = np.clip((middles * divisions).astype(np.int64), 0, divisions - 1)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # Faces of a fold or a thin sheet are distinguished by the axis along which the normal is longest.
    axis = np.abs(normals).argmax(axis=1)
    side = 2 * axis + (np.take_along_axis(normals, axis[:, None], axis=1)[:, 0] > 0.0)
    key = ((cell[:, 0] * divisions + cell[:, 1]) * divisions + cell[:, 2]) * 6 + side
    _, starts, count = np.unique(key, return_inverse=True, return_counts=True)
    mean = np.stack([np.bincount(starts, middles[:, a]) / count for a in range(3)], axis=1)
    away = ((middles - mean[starts]) ** 2).sum(axis=1)
    by_point = np.lexsort((away, starts))
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    return by_point[first].astype(np.int32), starts.astype(np.int32)


def build_inner_rows(surface: Surface, n: int, points: Int32s) -> Int32s:
    """Rows of the table for some of the points: batches of them can be tasks of their own.

    Args:
        surface: ``surface_of``.
        n: samples along an edge of the cube.
        points: (points,) faces from whose middles rays leave.

    Returns:
        Faces, (points, 6n²), as in ``InnerField``.

    Raises:
        InvalidInput: as ``check_samples``.
    """
    check_samples(n)
    faces = np.empty((len(points), 6 * n * n), dtype=np.int32)
    _fill_rows(surface, points, samples(n), faces)
    return faces


def inner_field(n: int, starts: Int32s, batches: list[Int32s]) -> InnerField:
    """Batches of rows, in order, as one table.

    Args:
        n: samples along an edge of the cube.
        starts: of ``spread_points``.
        batches: of ``build_inner_rows``.

    Raises:
        InvalidInput: as ``check_samples``, and where the rows are not those of all points.
    """
    check_samples(n)
    faces = np.concatenate(batches)
    if faces.shape != (int(starts.max()) + 1, 6 * n * n):
        raise InvalidInput("batches", f"rows {faces.shape}", f"{int(starts.max()) + 1} rows of {6 * n * n}")
    return InnerField(n, starts, faces)


@kernel
def _fill_rows(surface: Surface, points: Int32s, places: Floats, faces: Int32s) -> None:
    waiting = np.empty(WAITING, dtype=np.int32)
    for row in range(len(points)):
        corners = surface.triangles[points[row]]
        s = (
            (corners[0] + corners[3] + corners[6]) / 3.0,
            (corners[1] + corners[4] + corners[7]) / 3.0,
            (corners[2] + corners[5] + corners[8]) / 3.0,
        )
        for exit_ in range(len(places)):
            along = (places[exit_, 0] - s[0], places[exit_, 1] - s[1], places[exit_, 2] - s[2])
            faces[row, exit_] = closest(surface, waiting, 0, s, along, 0.0, 1.0, int64(points[row]))[0]

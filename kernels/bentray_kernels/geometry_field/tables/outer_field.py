"""The outer geometry field: the first hit of the ray between every pair of samples of the cube.

Dissertation, sections 5.2.2 and 5.3.3. The table contains a face and a position on the ray instead of (u, v),
which follow from the face: so values of different faces are never averaged.
"""

from typing import NamedTuple

import numpy as np

from ...arrays import Float32s, Floats, Int32s
from ...compilation.compiled import kernel
from ...errors import InvalidInput
from ...meshes.intersector import WAITING, closest
from ...meshes.surface import Surface
from .cube import check_samples, samples


class OuterField(NamedTuple):
    """The table.

    Attributes:
        samples: n along an edge of the cube.
        faces: (6n², 6n²) int32 by entry and exit: rows of ``Surface.triangles``; −1 where the ray meets none,
            and −2 − f where a neighbouring entry meets the face f: see ``boundary_face``.
        fractions: (6n², 6n²) float32: of the way from entry to exit, 1 where the ray meets none.
    """

    samples: int
    faces: Int32s
    fractions: Float32s


def build_rows(surface: Surface, n: int, first: int, last: int) -> tuple[Int32s, Float32s]:
    """Rows ``first`` to ``last`` − 1 of the table: batches of them can be tasks of their own.

    Args:
        surface: ``surface_of``.
        n: samples along an edge of the cube.
        first, last: 0 to 6n².

    Returns:
        Faces and fractions, (last − first, 6n²) each, as in ``OuterField``.

    Raises:
        InvalidInput: as ``check_samples``, and for rows that there are not.
    """
    check_samples(n)
    if not 0 <= first <= last <= 6 * n * n:
        raise InvalidInput("rows", (first, last), f"a range within 0 to {6 * n * n}")
    faces = np.empty((last - first, 6 * n * n), dtype=np.int32)
    fractions = np.empty(faces.shape, dtype=np.float32)
    _fill_rows(surface, samples(n), first, faces, fractions)
    return faces, fractions


def outer_field(n: int, batches: list[tuple[Int32s, Float32s]]) -> OuterField:
    """Batches of rows, in order, as one table.

    Raises:
        InvalidInput: as ``check_samples``, and where the rows are not all there are.
    """
    check_samples(n)
    faces = np.concatenate([batch[0] for batch in batches])
    if faces.shape != (6 * n * n, 6 * n * n):
        raise InvalidInput("batches", f"rows {faces.shape}", f"{6 * n * n} rows of {6 * n * n}")
    mark_borders(n, faces)
    return OuterField(n, faces, np.concatenate([batch[1] for batch in batches]))


@kernel(inline="always")
def boundary_face(face: int) -> int:
    """The first face of a walk: of the entry, or of a neighbour at the silhouette; −1 for neither."""
    return face if face >= -1 else -2 - face


@kernel
def mark_borders(n: int, faces: Int32s) -> None:
    """Mark entries without a hit with the face of one of their eight neighbours; idempotent.

    Args:
        n: samples along an edge of the cube.
        faces: (6n², 6n²), changed: all rows of ``build_rows``.
    """
    row = 6 * n
    for i in range(len(faces)):
        for j in range(len(faces)):
            if faces[i, j] >= 0:
                continue
            for step, here, last in ((1, j % n, n - 1), (row, j // row, n - 1)):
                for at, there in ((here > 0, j - step), (here < last, j + step)):
                    if at and faces[i, there] >= 0:
                        faces[i, j] = -2 - faces[i, there]
            for step, here, last in ((1, i % n, n - 1), (row, i // row, n - 1)):
                for at, there in ((here > 0, i - step), (here < last, i + step)):
                    if at and faces[there, j] >= 0:
                        faces[i, j] = -2 - faces[there, j]


@kernel
def _fill_rows(surface: Surface, places: Floats, first: int, faces: Int32s, fractions: Float32s) -> None:
    waiting = np.empty(WAITING, dtype=np.int32)
    for row in range(len(faces)):
        s = (places[first + row, 0], places[first + row, 1], places[first + row, 2])
        for exit_ in range(len(places)):
            t = (places[exit_, 0], places[exit_, 1], places[exit_, 2])
            faces[row, exit_], fractions[row, exit_] = -1, 1.0
            # A line along a face of the cube only touches the inside.
            if (s[0] == t[0] and s[0] * (1.0 - s[0]) == 0.0) or (
                (s[1] == t[1] and s[1] * (1.0 - s[1]) == 0.0) or (s[2] == t[2] and s[2] * (1.0 - s[2]) == 0.0)
            ):
                continue
            along = (t[0] - s[0], t[1] - s[1], t[2] - s[2])
            face, fraction, _, _, _ = closest(surface, waiting, 0, s, along, 0.0, 1.0, -1)
            if face >= 0:
                faces[row, exit_], fractions[row, exit_] = face, fraction

"""Backdrops: images behind the object, flat or on height fields, and their intersection with rays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats, Ints
from ..compilation.compiled import kernel
from ..errors import InvalidInput
from .relief import Place, meet_relief
from .texels import Texels, packed

Colours = NDArray[np.uint8]


@dataclass(frozen=True)
class Plane:
    """A rectangle with a picture on it, or a height field over it.

    Attributes:
        centre: (3,) m.
        right: (3,) from its left to its right edge, m.
        down: (3,) from its upper to its lower edge, perpendicular to ``right``, m.
        picture: (rows, columns, 3) 8-bit RGB.
        repeats: number of copies of the picture along each edge of the rectangle.
        smooth: whether colours are interpolated between pixel centres; else pixels are squares.
        endless: whether the pattern continues beyond the rectangle.
        relief: (rows, columns), 2 × 2 or more, heights of the surface over the rectangle along right × down,
            m, at nodes from edge to edge, bilinear between them and mirrored beyond; None: flat.
    """

    centre: tuple[float, float, float]
    right: tuple[float, float, float]
    down: tuple[float, float, float]
    picture: Colours
    repeats: float = 1.0
    smooth: bool = True
    endless: bool = False
    relief: Floats | None = None

    def __post_init__(self) -> None:
        picture = self.picture
        if picture.ndim != 3 or picture.shape[2] != 3 or picture.dtype != np.uint8 or picture.size == 0:
            raise InvalidInput("picture", f"{picture.dtype} {picture.shape}", "uint8 (rows, columns, 3)")
        right, down = np.asarray(self.right), np.asarray(self.down)
        lengths = np.linalg.norm(right), np.linalg.norm(down)
        if not (min(lengths) > 0.0 and abs(right @ down) < 1e-6 * lengths[0] * lengths[1]):
            raise InvalidInput("right, down", (self.right, self.down), "two perpendicular edges, m")
        if not self.repeats > 0.0:
            raise InvalidInput("repeats", self.repeats, "a number > 0")
        relief = self.relief
        if relief is not None and (
            relief.ndim != 2 or min(relief.shape) < 2 or not np.isfinite(relief).all()
        ):
            raise InvalidInput(
                "relief", f"shape {relief.shape}", "finite heights (rows, columns), 2 x 2 or more, m"
            )


def checkerboard(
    centre: Sequence[float],
    right: Sequence[float],
    down: Sequence[float],
    squares: int,
    colours: ArrayLike = ((255, 255, 255), (40, 40, 40)),
) -> Plane:
    """An endless checkerboard with so many squares along the edges of the rectangle."""
    first, second = np.asarray(colours, dtype=np.uint8)
    picture = np.array([[first, second], [second, first]])
    edges = [tuple(float(x) for x in edge) for edge in (centre, right, down)]
    return Plane(edges[0], edges[1], edges[2], picture, squares / 2.0, False, True)  # type: ignore[arg-type]


class Backdrop(NamedTuple):
    """Planes for compiled functions.

    Attributes:
        frames: (planes, 4, 3): centre; across and down, divided by their squared lengths; normal.
        edges: (planes, 2) lengths of the edges, m.
        repeats: (planes,).
        tables: (planes, 9): place of the picture's first number, rows, columns, smooth, endless; place of the
            first height, rows and columns of the relief, 0 where it is flat; place of the first packed texel.
        pictures: all pictures, one after the other.
        texels: ``texels.packed`` of all smooth pictures, one after the other.
        reliefs: all heights, one after the other, m.
        heights: (planes, 2) between which all of a plane's heights are, with room for rounding, m.
        beyond: (3,) colour where a ray ends on no plane.
    """

    frames: Floats
    edges: Floats
    repeats: Floats
    tables: Ints
    pictures: Colours
    texels: Texels
    reliefs: Floats
    heights: Floats
    beyond: Colours


def backdrop_of(planes: Sequence[Plane], beyond: ArrayLike = (0, 0, 0)) -> Backdrop:
    """One or more planes; a ray ends on the first that it meets.

    Raises:
        InvalidInput: without a plane.
    """
    if not planes:
        raise InvalidInput("planes", "none", "at least one plane")
    frames, tables, texels = [], [], [np.zeros(0, dtype=np.uint64)]
    start = height = first = 0
    for plane in planes:
        right, down = np.asarray(plane.right), np.asarray(plane.down)
        normal = np.cross(right, down)
        frames.append(
            [plane.centre, right / (right @ right), down / (down @ down), normal / np.linalg.norm(normal)]
        )
        relief = np.zeros((0, 0)) if plane.relief is None else plane.relief
        tables.append(
            [start, *plane.picture.shape[:2], plane.smooth, plane.endless, height, *relief.shape, first]
        )
        if plane.smooth:
            texels.append(packed(plane.picture, plane.endless or plane.repeats != 1.0).ravel())
            first += texels[-1].size
        start += plane.picture.size
        height += relief.size
    edges = [[np.linalg.norm(plane.right), np.linalg.norm(plane.down)] for plane in planes]
    return Backdrop(
        np.array(frames, dtype=np.float64),
        np.array(edges),
        np.array([plane.repeats for plane in planes]),
        np.array(tables, dtype=np.int64),
        np.concatenate([plane.picture.ravel() for plane in planes]),
        np.concatenate(texels),
        np.concatenate(
            [np.zeros(0), *(np.ravel(plane.relief) for plane in planes if plane.relief is not None)]
        ),
        np.array(
            [
                _range_of(plane.relief, room)
                for plane, room in zip(planes, 1e-6 * np.max(edges, axis=1), strict=True)
            ]
        ),
        np.asarray(beyond, dtype=np.uint8),
    )


def _range_of(relief: Floats | None, room: float) -> tuple[float, float]:
    return (0.0, 0.0) if relief is None else (float(relief.min()) - room, float(relief.max()) + room)


@kernel
def locate(
    backdrop: Backdrop, points: Floats, directions: Floats, planes: NDArray[np.int8], places: Floats
) -> None:
    """Where rays end.

    Args:
        backdrop: the planes.
        points: (n, 3) on each ray, m.
        directions: (n, 3).
        planes: (n,), filled with the number of the plane, −1 where there is none.
        places: (n, 2), filled with the place from the plane's centre, in edges, right and down; NaN for none.
            On a relief that of the point of the rectangle below.
    """
    for n in range(len(points)):
        nearest = np.inf
        planes[n] = -1
        places[n, 0] = places[n, 1] = np.nan
        for m in range(len(backdrop.frames)):
            if backdrop.tables[m, 6] > 0:
                s, u, v = _on_relief(backdrop, m, points[n], directions[n], nearest)
                if s < nearest:
                    nearest = s
                    planes[n], places[n, 0], places[n, 1] = m, u, v
                continue
            across = away = 0.0
            for axis in range(3):
                across += directions[n, axis] * backdrop.frames[m, 3, axis]
                away += (backdrop.frames[m, 0, axis] - points[n, axis]) * backdrop.frames[m, 3, axis]
            if across == 0.0 or not 0.0 < away / across < nearest:
                continue
            s = away / across
            u = v = 0.0
            for axis in range(3):
                offset = points[n, axis] + s * directions[n, axis] - backdrop.frames[m, 0, axis]
                u += offset * backdrop.frames[m, 1, axis]
                v += offset * backdrop.frames[m, 2, axis]
            if backdrop.tables[m, 4] or (abs(u) <= 0.5 and abs(v) <= 0.5):
                nearest = s
                planes[n], places[n, 0], places[n, 1] = m, u, v


@kernel
def _on_relief(backdrop: Backdrop, m: int, point: Floats, direction: Floats, nearest: float) -> Place:
    start, rows, columns = backdrop.tables[m, 5], backdrop.tables[m, 6], backdrop.tables[m, 7]
    heights = backdrop.reliefs[start : start + rows * columns].reshape(rows, columns)
    u = v = w = du = dv = dw = 0.0
    for axis in range(3):
        offset, along = point[axis] - backdrop.frames[m, 0, axis], direction[axis]
        u, du = u + offset * backdrop.frames[m, 1, axis], du + along * backdrop.frames[m, 1, axis]
        v, dv = v + offset * backdrop.frames[m, 2, axis], dv + along * backdrop.frames[m, 2, axis]
        w, dw = w + offset * backdrop.frames[m, 3, axis], dw + along * backdrop.frames[m, 3, axis]
    low, high = backdrop.heights[m]
    endless = backdrop.tables[m, 4] != 0
    return meet_relief(heights, endless, (u, v, w), (du, dv, dw), low, high, nearest)


@kernel(inline="always")
def colour_at(backdrop: Backdrop, plane: int, u: float, v: float) -> tuple[float, float, float]:
    """Colour at a place of a plane, as ``locate`` gives it; 0 to 255."""
    if plane < 0:
        return float(backdrop.beyond[0]), float(backdrop.beyond[1]), float(backdrop.beyond[2])
    start, rows, columns = backdrop.tables[plane, 0], backdrop.tables[plane, 1], backdrop.tables[plane, 2]
    repeats = backdrop.repeats[plane]
    x, y = (u + 0.5) * repeats, (v + 0.5) * repeats
    x, y = (x - np.floor(x)) * columns, (y - np.floor(y)) * rows
    if not backdrop.tables[plane, 3]:
        at = start + 3 * (min(int(y), rows - 1) * columns + min(int(x), columns - 1))
        return (
            float(backdrop.pictures[at]),
            float(backdrop.pictures[at + 1]),
            float(backdrop.pictures[at + 2]),
        )
    left, upper = int(np.floor(x - 0.5)), int(np.floor(y - 0.5))
    t, w = x - 0.5 - left, y - 0.5 - upper
    # Beyond its edge a single picture keeps its last pixel, a repeated one is periodic.
    alone = repeats == 1.0 and not backdrop.tables[plane, 4]
    x0, x1 = _column(left, columns, alone), _column(left + 1, columns, alone)
    y0, y1 = _column(upper, rows, alone) * columns, _column(upper + 1, rows, alone) * columns
    a, b, c, d = start + 3 * (y0 + x0), start + 3 * (y0 + x1), start + 3 * (y1 + x0), start + 3 * (y1 + x1)
    return (
        _mixed(backdrop.pictures, a, b, c, d, t, w),
        _mixed(backdrop.pictures, a + 1, b + 1, c + 1, d + 1, t, w),
        _mixed(backdrop.pictures, a + 2, b + 2, c + 2, d + 2, t, w),
    )


@kernel(inline="always")
def _column(index: int, count: int, alone: bool) -> int:
    return min(max(index, 0), count - 1) if alone else index % count


@kernel(inline="always")
def _mixed(pictures: Colours, a: int, b: int, c: int, d: int, t: float, w: float) -> float:
    upper = (1.0 - t) * pictures[a] + t * pictures[b]
    lower = (1.0 - t) * pictures[c] + t * pictures[d]
    return float((1.0 - w) * upper + w * lower)


@kernel(inline="always")
def paint(image: Colours, i: int, j: int, colour: Any, scale: float) -> None:
    """Set a pixel to a colour, three numbers, times ``scale``; rounded."""
    for c in range(3):
        image[i, j, c] = np.uint8(colour[c] * scale + 0.5)

"""Stitching of a geometry image into a mesh: pixels to the seam, and both sides of the seam."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay, cKDTree

from ...arrays import Flags, Floats, Ints
from ...compilation.compiled import kernel
from ...meshes.mesh import Chart, TriangleMesh
from ...meshes.topology import topology_of
from .raster import INSIDE, Raster, seam_sides

# Distances in pixels: between points on the seam at most; of a pixel from the seam, to be a vertex; and of
# the corners of a cell, to be a quadrangle. Circles about the sides of such cells hold no point of the seam,
# so that these sides are in the Delaunay triangulation.
STEP, NEAR, CLEAR = 0.7, 0.4, 1.2

# How often pieces of the seam that the triangulation lacks are halved.
HALVINGS = 6

# Twice the area of a triangle that is only rounding, pixels².
FLAT = 1e-9


@dataclass(frozen=True)
class Seam:
    """The boundary of a chart in short pieces.

    Attributes:
        uv: (points, 2) of each piece's start, in pixels.
        ahead: (points,) the point where the piece ends.
        vertex: (points,) the vertex that the point becomes; the two sides of a cut share theirs.
        edge: (points,) the edge of the mesh that the piece belongs to.
        places: (vertices, 3).
    """

    uv: Floats
    ahead: Ints
    vertex: Ints
    edge: Ints
    places: Floats


def stitched(chart: Chart, raster: Raster) -> TriangleMesh:
    """The surface of an image: closed where the mesh is closed, with as many handles and holes.

    Inside there are two triangles for each cell of pixels, cut along its shorter diagonal. The strip between
    these and the seam is triangulated with the points of the seam, which are those of the mesh and points
    between them, so that no triangle crosses it. Where the chart is narrower than a pixel, the result may
    touch itself.

    Args:
        chart: what was sampled.
        raster: its pixels.
    """
    scale = len(raster.kind) - 1
    sides = seam_sides(chart)
    edges = topology_of(chart.mesh.faces).side_edge[sides]
    divisions = _parts(chart, sides, edges, scale)
    for _ in range(HALVINGS):
        seam = _seam(chart, sides, edges, divisions, scale)
        pixels, quads = _inner(raster, seam)
        strip, missing = _strip(pixels, quads, seam)
        if not missing.any():
            break
        divisions[np.isin(edges, seam.edge[missing])] *= 2
    numbers = np.full(raster.kind.shape, -1)
    numbers[tuple(pixels.T)] = np.arange(len(pixels))
    inner = np.argwhere(_in_quads(quads) & (numbers < 0))
    numbers[tuple(inner.T)] = len(pixels) + len(seam.uv) + np.arange(len(inner))
    positions = raster.sampled(chart.mesh.corners)
    faces = np.concatenate((strip, _quad_faces(quads, numbers, positions)))
    # Points in the order: pixels of the strip, the seam, pixels inside; those of the seam are shared.
    first, last = len(pixels), len(pixels) + len(seam.uv)
    vertex = np.concatenate(
        (np.arange(first), first + seam.vertex, first + len(seam.places) + np.arange(len(inner)))
    )
    assert last + len(inner) == len(vertex)
    points = np.concatenate((positions[tuple(pixels.T)], seam.places, positions[tuple(inner.T)]))
    used, inverse = np.unique(_without_folds(vertex[faces]), return_inverse=True)
    return TriangleMesh(points[used], inverse.reshape(-1, 3).astype(np.int32))


def _without_folds(faces: Ints) -> Ints:
    """The faces less the pairs that lie on each other.

    At a corner of the seam a triangle on either side may have the same three points, all of the seam.
    """
    ordered = np.sort(faces, axis=1)
    _, inverse, count = np.unique(ordered, axis=0, return_inverse=True, return_counts=True)
    return np.asarray(faces[count[inverse.ravel()] == 1])


def _parts(chart: Chart, sides: Ints, edges: Ints, scale: int) -> Ints:
    """(sides,) in how many parts each is cut: the same on both sides of an edge."""
    uv = chart.uv.reshape(-1, 2)
    length = np.linalg.norm(np.roll(chart.uv, -1, axis=1).reshape(-1, 2)[sides] - uv[sides], axis=1) * scale
    longest = np.zeros(int(edges.max()) + 1)
    np.maximum.at(longest, edges, length)
    return np.maximum(np.ceil(longest[edges] / STEP).astype(np.int64), 1)


def _seam(chart: Chart, sides: Ints, edges: Ints, divisions: Ints, scale: int) -> Seam:
    faces = chart.mesh.faces.astype(np.int64)
    start_uv, end_uv = chart.uv.reshape(-1, 2)[sides], np.roll(chart.uv, -1, axis=1).reshape(-1, 2)[sides]
    start, end = faces.reshape(-1)[sides], np.roll(faces, -1, axis=1).reshape(-1)[sides]
    first = np.concatenate(([0], np.cumsum(divisions)[:-1]))
    side = np.repeat(np.arange(len(sides)), divisions)
    step = np.arange(len(side)) - first[side]
    share = (step / divisions[side])[:, np.newaxis]
    uv = (start_uv[side] * (1.0 - share) + end_uv[side] * share) * scale
    # An edge's points are numbered from its lower vertex; the vertices themselves come first.
    upward = (start < end)[side]
    along = np.where(upward, step, divisions[side] - step)
    corners, corner = np.unique(start, return_inverse=True)
    names, name = np.unique(edges, return_inverse=True)
    most = np.zeros(len(names), np.int64)
    most[name] = divisions
    offset = len(corners) + np.concatenate(([0], np.cumsum(most - 1)[:-1]))
    vertex = np.where(step == 0, corner[side], offset[name[side]] + along - 1)
    low, high = np.where(start < end, (start, end), (end, start))
    points = np.empty((len(corners) + int((most - 1).sum()), 3))
    points[: len(corners)] = chart.mesh.vertices[corners]
    between = step > 0
    fraction = (along / divisions[side])[between, np.newaxis]
    ends = chart.mesh.vertices[low[side[between]]], chart.mesh.vertices[high[side[between]]]
    points[vertex[between]] = ends[0] * (1.0 - fraction) + ends[1] * fraction
    # A side ends where another one starts at the same corner of the chart.
    following = _following(chart, sides)
    last = step == divisions[side] - 1
    ahead = np.where(last, first[following[side]], np.arange(len(side)) + 1)
    return Seam(uv, ahead, vertex, edges[side], points)


def _following(chart: Chart, sides: Ints) -> Ints:
    """(sides,) index in ``sides`` of the side that starts where each one ends."""
    topology = topology_of(chart.mesh.faces)
    parted = np.zeros(len(topology.edges), bool)
    parted[topology.side_edge[sides]] = True
    fans = topology.fans(~parted)
    position = np.full(int(fans.max()) + 1, -1)
    position[fans[sides]] = np.arange(len(sides))
    return np.asarray(position[fans[sides - sides % 3 + (sides + 1) % 3]])


def _inner(raster: Raster, seam: Seam) -> tuple[Ints, Flags]:
    """(pixels, 2) that the strip takes up, and the cells, (n − 1, n − 1), that become quadrangles."""
    inside = np.argwhere(raster.kind == INSIDE)
    distance = np.zeros(raster.kind.shape)
    distance[tuple(inside.T)] = cKDTree(seam.uv).query(inside, distance_upper_bound=4.0)[0]
    clear = distance >= CLEAR
    quads = clear[:-1, :-1] & clear[1:, :-1] & clear[:-1, 1:] & clear[1:, 1:]
    surrounded = np.zeros_like(clear)
    surrounded[1:-1, 1:-1] = quads[:-1, :-1] & quads[1:, :-1] & quads[:-1, 1:] & quads[1:, 1:]
    return np.argwhere((distance >= NEAR) & ~surrounded), quads


def _in_quads(quads: Flags) -> Flags:
    """(n, n) whether a pixel is a corner of a quadrangle."""
    size = len(quads) + 1
    covered = np.zeros((size, size), bool)
    for i, j in np.ndindex(2, 2):
        covered[i : size - 1 + i, j : size - 1 + j] |= quads
    return covered


def _strip(pixels: Ints, quads: Flags, seam: Seam) -> tuple[Ints, Flags]:
    """The triangles between quadrangles and seam.

    Returns:
        (faces, 3) rows of the pixels and, after them, the points of the seam; (points,) which pieces of the
        seam are no side of a triangle.
    """
    points = np.concatenate((pixels.astype(np.float64), seam.uv))
    faces = Delaunay(points).simplices.astype(np.int64)
    corners = points[faces]
    first, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    double = first[:, 0] * other[:, 1] - first[:, 1] * other[:, 0]
    faces = np.where((double < 0.0)[:, np.newaxis], faces[:, ::-1], faces)
    middle = corners.mean(axis=1)
    cell = np.clip(middle.astype(np.int64), 0, len(quads) - 1)
    valid = (np.abs(double) > FLAT) & ~quads[tuple(cell.T)]
    faces, middle = faces[valid], middle[valid]
    faces = faces[_within(middle, seam.uv, seam.uv[seam.ahead])]
    piece = len(pixels) + np.column_stack((np.arange(len(seam.uv)), seam.ahead))
    starts, ends = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    missing = ~np.isin(piece[:, 0] * len(points) + piece[:, 1], starts * len(points) + ends)
    return faces, missing


@kernel
def _within(points: Floats, starts: Floats, ends: Floats) -> Flags:
    """(points,) whether each of (points, 2) lies within a closed curve: a ray crosses it in odd number."""
    inside = np.zeros(len(points), np.bool_)
    order = np.argsort(points[:, 1])
    sorted_y = points[order, 1]
    for piece in range(len(starts)):
        ax, ay, bx, by = starts[piece, 0], starts[piece, 1], ends[piece, 0], ends[piece, 1]
        first = np.searchsorted(sorted_y, min(ay, by))
        last = np.searchsorted(sorted_y, max(ay, by))
        for k in range(first, last):
            p = order[k]
            if points[p, 0] < ax + (points[p, 1] - ay) / (by - ay) * (bx - ax):
                inside[p] = not inside[p]
    return inside


def _quad_faces(quads: Flags, numbers: Ints, positions: Floats) -> Ints:
    """(2·cells, 3), each cell cut along the diagonal that is shorter on the surface."""
    a, b, c, d = (
        numbers[i : len(quads) + i, j : len(quads) + j][quads] for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))
    )
    first = np.linalg.norm(positions[1:, 1:] - positions[:-1, :-1], axis=-1)[quads]
    second = np.linalg.norm(positions[1:, :-1] - positions[:-1, 1:], axis=-1)[quads]
    along = (first <= second)[:, np.newaxis]
    lower = np.where(along, np.column_stack((a, b, c)), np.column_stack((a, b, d)))
    other = np.where(along, np.column_stack((a, c, d)), np.column_stack((b, c, d)))
    return np.concatenate((lower, other))

"""Convex hull of an array: the nodes and places inside it, farther than a rim from its faces and elements."""

from itertools import product

import numpy as np

from ..arrays import Flags, Floats
from ..errors import InvalidInput

POSITION = "geometry/element_position_m"

# An array narrower than this part of its length is a line, or a plane in 3-D.
FLAT = 1e-6

# Facets whose normal has a larger component along z are lids.
LEVEL = 0.999

# Part of a node by which a place on the edge of the region may be outside by rounding.
ROUNDING = 1e-6


def check_extent(position_m: Floats) -> None:
    """Check that elements lie on several sides of an object.

    Args:
        position_m: (elements, 2 or 3), m.

    Raises:
        InvalidInput: for elements at one point or on one line, and in 3-D in one plane.
    """
    centred = position_m - position_m.mean(axis=0)
    sizes = np.linalg.svd(centred, compute_uv=False) if len(centred) else np.zeros(1)
    rank = int((sizes > FLAT * sizes[0]).sum()) if sizes[0] > 0.0 else 0
    if rank == position_m.shape[1]:
        return
    where = ("at one point", "on one line", "in one plane")[rank]
    raise InvalidInput(
        POSITION,
        f"all elements {where}",
        "emitters and receivers on several sides of the object: transmission needs paths across it",
    )


def inside_array(
    position_m: Floats,
    shape: tuple[int, ...],
    spacing: float,
    origin: tuple[float, ...] | Floats,
    rim_nodes: float,
) -> Flags:
    """Nodes inside the convex hull of the elements, farther than the rim from its faces and from elements.

    The open ends of stacked rings in 3-D, horizontal faces without elements inside them, are no limit: rays
    between the rings may bend a little above and below them.

    Args:
        position_m: (elements, ndim), m.
        shape: of the image, nodes.
        spacing: node spacing, m.
        origin: position of node 0, m.
        rim_nodes: width of the rim, nodes.

    Raises:
        InvalidInput: as ``check_extent``.
    """
    check_extent(position_m)
    position = (position_m - np.asarray(origin)) / spacing
    lines = [np.arange(n, dtype=np.float64) for n in shape]
    columns = np.stack(np.meshgrid(*lines[:-1], indexing="ij"), axis=-1)
    # The hull is convex: of each column of nodes along the last axis it holds one interval.
    low, high = np.full(shape[:-1], -np.inf), np.full(shape[:-1], np.inf)
    for *normal, offset in _faces(position, rim_nodes):
        excess = columns @ np.array(normal[:-1]) + (offset + rim_nodes - ROUNDING)
        if abs(normal[-1]) < FLAT:
            high[excess > 0.0] = -np.inf
        elif normal[-1] > 0.0:
            np.minimum(high, -excess / normal[-1], out=high)
        else:
            np.maximum(low, -excess / normal[-1], out=low)
    region = (lines[-1] >= low[..., None]) & (lines[-1] <= high[..., None])
    _clear_near(region, position, rim_nodes)
    return np.asarray(region)


def depth_inside(position_m: Floats, places_m: Floats) -> Floats:
    """Distance of places from the nearest face of the hull of the elements, (places,), m; < 0 outside.

    Args:
        position_m: (elements, ndim), m.
        places_m: (places, ndim), m.

    Raises:
        InvalidInput: as ``check_extent``.
    """
    check_extent(position_m)
    faces = _hull(position_m)
    return np.asarray(-(places_m @ faces[:, :-1].T + faces[:, -1]).max(axis=1))


def _hull(position: Floats) -> Floats:
    """Outward unit normals and offsets of the faces of the hull, (faces, ndim + 1)."""
    # SciPy is not needed to check an upload, which imports this module.
    from scipy.spatial import ConvexHull

    # Flat faces are divided into triangles, each with the same equation.
    return np.unique(np.round(ConvexHull(position).equations, 9), axis=0)


def _faces(position: Floats, rim_nodes: float) -> Floats:
    """Outward unit normals and offsets of the faces of the hull, (faces, ndim + 1), without open ends."""
    faces = _hull(position)
    if position.shape[1] == 2:
        return faces
    for end in (1.0, -1.0):
        lid = end * faces[:, 2] > LEVEL
        if lid.any() and _open(position, end, rim_nodes):
            faces = faces[~lid]
    return faces


def _open(position: Floats, end: float, rim_nodes: float) -> bool:
    """Whether the upper (1) or lower (-1) face of an array has no elements but those of its edge."""
    height = end * position[:, 2]
    flat = position[height >= height.max() - 0.5][:, :2]
    centred = flat - flat.mean(axis=0)
    sizes = np.linalg.svd(centred, compute_uv=False)
    if len(flat) < 3 or sizes[-1] <= FLAT * sizes[0]:
        return True
    faces = _faces(flat, rim_nodes)
    depth = -(flat @ faces[:, :2].T + faces[:, 2]).max(axis=1)
    return not (depth > rim_nodes).any()


def _clear_near(region: Flags, position: Floats, rim_nodes: float) -> None:
    """Remove the nodes nearer to an element than the rim; ``position`` in nodes."""
    reach = int(np.ceil(rim_nodes))
    first = np.floor(position).astype(np.int64)
    for step in product(range(-reach, reach + 2), repeat=position.shape[1]):
        node = first + np.array(step)
        near = np.linalg.norm(node - position, axis=1) < rim_nodes - ROUNDING
        near &= ((node >= 0) & (node < region.shape)).all(axis=1)
        region[tuple(node[near].T)] = False

"""The connected pieces of a mesh."""

import numpy as np

from .mesh import TriangleMesh
from .topology import topology_of


def pieces_of(mesh: TriangleMesh) -> list[TriangleMesh]:
    """Each piece as a separate mesh, the one of largest area first; pieces are connected by edges.

    Raises:
        InvalidInput: as ``topology_of``.
    """
    label = topology_of(mesh.faces).pieces
    areas = np.bincount(label, np.linalg.norm(mesh.face_normals, axis=1))
    result = []
    for piece in np.argsort(-areas, kind="stable"):
        used, inverse = np.unique(mesh.faces[label == piece], return_inverse=True)
        result.append(TriangleMesh(mesh.vertices[used], inverse.reshape(-1, 3).astype(np.int32)))
    return result

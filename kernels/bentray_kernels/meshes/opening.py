"""Cutting meshes along edges: both sides of a cut get separate vertices."""

from dataclasses import dataclass

import numpy as np

from ..arrays import Flags, Ints
from .topology import Topology


@dataclass(frozen=True)
class OpenMesh:
    """Faces after a cut.

    Attributes:
        faces: (faces, 3) rows of ``origin``.
        origin: (vertices after the cut,) the vertex of the mesh that each comes from.
    """

    faces: Ints
    origin: Ints


def cut_open(topology: Topology, cut: Flags) -> OpenMesh:
    """Part the faces along the edges of a cut.

    Corners of one vertex stay together where a walk round it from one to the other crosses no cut edge. So a
    cut of a lone edge opens nothing, and no cut at all parts fans of faces that touch in a vertex alone.

    Args:
        topology: of the mesh.
        cut: (edges,) which edges to part.
    """
    labels = topology.fans(~topology.on_boundary & ~cut)
    _, first = np.unique(labels, return_index=True)
    return OpenMesh(labels.reshape(-1, 3), topology.faces.ravel()[first])

"""Mesh files: ``bentray-mesh`` in HDF5, and the summary of a mesh."""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bentray_kernels.arrays import Floats
from bentray_kernels.meshes.defects import SoundMesh
from bentray_kernels.meshes.mesh import TriangleMesh

from .hdf5_reading import opened
from .hdf5_writing import atomic_hdf5, write_packed

FORMAT = "bentray-mesh"
VERSION = "1.0"


@dataclass(frozen=True)
class StoredMesh:
    """A mesh without defects, see ``defects.sound``.

    Attributes:
        mesh: vertices in any unit.
        colours: (vertices, 3) in [0, 1], or None.
    """

    mesh: TriangleMesh
    colours: Floats | None = None

    @property
    def nbytes(self) -> int:
        """Size of its arrays, uncompressed."""
        arrays = (self.mesh.vertices, self.mesh.faces, self.colours)
        return sum(array.nbytes for array in arrays if array is not None)

    def content(self) -> str:
        """SHA-256 of vertices, faces and colours, in hexadecimal."""
        digest = hashlib.sha256()
        arrays = (self.mesh.vertices, self.mesh.faces, self.colours)
        for array, kind in zip(arrays, ("<f8", "<i4", "<f8"), strict=True):
            values = np.zeros(0) if array is None else array
            digest.update(repr(values.shape).encode())
            digest.update(np.ascontiguousarray(values, dtype=kind).tobytes())
        return digest.hexdigest()


def summary_of(stored: StoredMesh, surface: SoundMesh, kind: str, pieces: int = 1) -> dict[str, Any]:
    """Summary of a mesh in plain values.

    Args:
        stored: the mesh.
        surface: with the repairs.
        kind: format of the uploaded file, or "isosurface".
        pieces: number of connected pieces, of which it is one.
    """
    repairs = {
        "merged_vertices": surface.merged,
        "unused_vertices": surface.unused,
        "flat_faces": surface.flat,
        "repeated_faces": surface.repeated,
        "turned_faces": surface.turned,
        "parted_vertices": surface.parted,
        "dropped_pieces": pieces - 1,
    }
    return {
        "format": kind,
        "vertices": len(stored.mesh.vertices),
        "faces": len(stored.mesh.faces),
        "genus": surface.genus,
        "holes": surface.holes,
        "coloured": stored.colours is not None,
        "repairs": repairs,
        "content": stored.content(),
    }


def write_mesh(path: Path, stored: StoredMesh) -> None:
    """Write a mesh; ``path`` is replaced atomically.

    Raises:
        OSError: where the folder cannot be written to or the disk is full.
    """
    with atomic_hdf5(path, FORMAT, VERSION) as file:
        arrays = {"vertices": stored.mesh.vertices, "faces": stored.mesh.faces, "colours": stored.colours}
        write_packed(file, arrays)


def stored_faces(path: Path) -> int:
    """Number of faces of a mesh, without reading them."""
    with opened(path) as reader:
        faces = reader.checked("faces", "i", "(faces, 3) rows of the vertices")
        return 0 if faces is None else int(faces.shape[0])


def load_mesh(path: Path) -> StoredMesh:
    """Read a mesh.

    Raises:
        InvalidInput: naming the first field that is missing or wrong.
    """
    with opened(path) as reader:
        reader.check_format(FORMAT, VERSION)
        vertices = reader.required("vertices", "f", "(vertices, 3) numbers")
        faces = reader.required("faces", "i", "(faces, 3) rows of the vertices")
        colours = reader.array("colours", "f", "(vertices, 3) numbers")
    return StoredMesh(TriangleMesh(vertices.astype(np.float64), faces.astype(np.int32)), colours)

"""Meshes and geometry fields in folders, for the tests of what makes and shows them."""

from pathlib import Path

from bentray_kernels.meshes.mesh import TriangleMesh
from bentray_workers.files.mesh import StoredMesh, write_mesh
from bentray_workers.rendering.field_settings import FieldSettings
from bentray_workers.rendering.geometry_field import build_field

SMALL = FieldSettings(samples=6, inner_samples=4, divisions=4, image_size=33)


def stored(folder: Path, mesh: TriangleMesh) -> Path:
    """A mesh as an upload leaves it."""
    path = folder / "mesh.h5"
    write_mesh(path, StoredMesh(mesh))
    return path


def field_of(folder: Path, mesh: TriangleMesh, settings: FieldSettings = SMALL) -> Path:
    """The folder of its field, made in threads."""
    work = folder / "work"
    work.mkdir()
    target = folder / "made"
    build_field(None, stored(folder, mesh), settings, target, work)
    return target

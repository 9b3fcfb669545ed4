"""The largest connected piece of an iso-surface of a volume, as a mesh."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput
from bentray_kernels.meshes.defects import sound
from bentray_kernels.meshes.marching import isosurface_mesh
from bentray_kernels.meshes.pieces import pieces_of

from ..files.mesh import StoredMesh, summary_of, write_mesh
from ..files.volume_formats import import_volume
from .refraction_view import check_even

MAX_NODES = 2**26
# Grid edges cut by the surface; it has about eight triangles for each.
MAX_CROSSINGS = 75_000
MAX_STEP = 32
# Per cut edge, without compression: eight triangles, and at most as many vertices.
EDGE_BYTES = 8 * (3 * 4 + 3 * 8)
HEADER_BYTES = 64 * 2**10


def check_nodes(shape: tuple[int, ...], step: int) -> None:
    """Reject a volume that is too large to be meshed.

    Raises:
        InvalidInput: naming ``step`` or ``volume``.
    """
    if not 1 <= step <= MAX_STEP:
        raise InvalidInput("step", step, f"a whole number from 1 to {MAX_STEP}")
    if np.prod(shape, dtype=np.int64) > MAX_NODES:
        raise InvalidInput("volume", f"shape {tuple(shape)}", f"at most {MAX_NODES} nodes")


def largest_bytes(shape: Sequence[int], step: int) -> int:
    """Largest size of the mesh of a volume of this shape, bytes."""
    nodes = math.prod(-(-n // step) for n in shape)
    return min(MAX_CROSSINGS, len(shape) * nodes) * EDGE_BYTES + HEADER_BYTES


def mesh_volume(path: Path, iso: float | None, step: int, target: Path) -> dict[str, Any]:
    """Task: write the mesh of a volume or reconstruction file.

    Args:
        path: of the 3-D volume with even spacing.
        iso: in the unit of the volume; None: the middle of its range.
        step: subsampling along each axis.
        target: the mesh file to write.

    Returns:
        ``files.mesh.summary_of``, and ``iso``.

    Raises:
        InvalidInput: from the file, for an iso-value out of range, and for a surface that is too large.
    """
    volume = import_volume(path)
    check_even(volume.values.shape, volume.spacing_m)
    check_nodes(volume.values.shape, step)
    values = volume.values[::step, ::step, ::step]
    if min(values.shape) < 2:
        raise InvalidInput("step", step, f"one that leaves two nodes of {min(volume.values.shape)} or more")
    level = float(0.5 * (values.min() + float(values.max()))) if iso is None else iso
    _check_size(values, level)
    whole = pieces_of(isosurface_mesh(values, step * np.array(volume.spacing_m), level))
    surface = sound(whole[0].vertices, whole[0].faces)
    stored = StoredMesh(surface.mesh)
    write_mesh(target, stored)
    return summary_of(stored, surface, "isosurface", len(whole)) | {"iso": level}


def _check_size(values: NDArray[Any], iso: float) -> None:
    # The surface is closed where values above it reach the border.
    above = np.pad(values > iso, 1)
    cuts = sum(int(np.count_nonzero(np.diff(above, axis=axis))) for axis in range(3))
    if cuts > MAX_CROSSINGS:
        accepted = f"at most {MAX_CROSSINGS}: a larger step, or an iso-value of a smaller surface"
        raise InvalidInput("iso", f"{iso:g}, whose surface cuts {cuts} edges of the grid", accepted)

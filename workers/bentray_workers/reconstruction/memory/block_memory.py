"""Memory of the tasks of SART in blocks, beyond that of a warm worker, and the disk space of their files."""

from __future__ import annotations

import math

from bentray_kernels.eikonal.diagonals import Diagonals
from bentray_kernels.rays.block_tracing import ABOVE, BELOW, GUARD
from bentray_kernels.tomography.sart.sart_update import smoothing_reach
from bentray_kernels.tomography.settings import Settings

from ...cluster.capacities import MIB, REAL

# Freed arrays of up to 32 MiB remain with the process (glibc), those of rays and updates beside the sweeps: a
# worker took up to 1.8 times the memory of its largest task, see ``bentray bench volume_in_blocks``.
KEPT_ARRAYS, KEPT_ARRAY_BYTES = 8, 32 * MIB

# Arrays of the nodes of a block beside the five of the sweeps: slowness and times, and their copies.
SWEEP_ARRAYS = 4

# Of the block with the planes of its neighbours: slowness, crossing times and one more; for curved rays T, T²
# and its gradient too.
STRAIGHT_ARRAYS, CURVED_ARRAYS = 3, 7

# Of the block with the planes that its smoothing reads: sums, update, filter, state, and their copies.
UPDATE_ARRAYS = 8

# Points of a ray per node of a side, and arrays of them while their file grows.
POINTS_PER_NODE, POINT_ARRAYS = 1.5, 3.5

# Arrays of the size of the volume in files: times before and after, sums, and three states of two images.
STORED_ARRAYS = 2 + 2 + 3 * 2


def block_task_parts(shape: tuple[int, ...], receivers: int, settings: Settings) -> dict[str, dict[str, int]]:
    """Memory of each task by its name and by what takes it, bytes.

    Args:
        shape: of the volume.
        receivers: of one emitter.
        settings: with ``numerics.blocks``.
    """
    blocks = min(settings.numerics.blocks, shape[0])
    plane = math.prod(shape[1:])
    own = -(-shape[0] // blocks)
    points = math.ceil(receivers * POINTS_PER_NODE * max(shape) * len(shape) * REAL)
    near = min(own + BELOW + ABOVE + 2 * GUARD, shape[0])
    smooth = min(own + 2 * smoothing_reach(settings), shape[0])
    traced = CURVED_ARRAYS if settings.rays == "curved" else STRAIGHT_ARRAYS
    rays = {"points of rays": math.ceil(POINT_ARRAYS * points)}
    parts = {
        "trace_rays_in_block": {"a block": traced * REAL * near * plane, **rays},
        "back_project_in_block": {"a block": 2 * REAL * near * plane, **rays},
        "update_block": {"a block": UPDATE_ARRAYS * REAL * smooth * plane},
    }
    if settings.rays == "curved":
        swept: int = 5 * REAL * Diagonals.from_shape((own, *shape[1:])).size
        parts["sweep_block"] = {"a block": SWEEP_ARRAYS * REAL * own * plane, "sweeps": swept}
    kept = KEPT_ARRAYS * min(KEPT_ARRAY_BYTES, REAL * near * plane)
    return {name: {**sizes, "freed arrays": kept} for name, sizes in parts.items()}


def block_files_bytes(shape: tuple[int, ...]) -> int:
    """Disk space of the files of all blocks during a reconstruction, without the points of rays."""
    return STORED_ARRAYS * REAL * math.prod(shape)

"""Whether a volume is reconstructed in blocks, and in how many: the fewest whose tasks fit a worker."""

import math
from collections.abc import Sequence

from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.solver_choice import undivided_reason

from ...cluster.capacities import WorkerCapacity
from ...files.dataset.counts import Summary
from ..ray_sizes import ray_task_sizes, shape_of

# Planes of a block, at least: with fewer most of a task would be planes of its neighbours.
FEWEST_PLANES = 8


def fitting_blocks(scan: Summary, settings: Settings, capacities: Sequence[WorkerCapacity]) -> int:
    """The number of blocks of a volume whose arrays fit no worker; else 1.

    Args:
        scan: the dataset.
        settings: with nodes and decomposition.
        capacities: of workers with the needed resource; without any, no limit is known.
    """
    if settings.numerics.blocks > 1 or undivided_reason(settings, amplitudes=scan.amplitudes):
        return settings.numerics.blocks
    limit = max((worker.task_bytes for worker in capacities), default=math.inf)
    most = shape_of(scan, settings)[0] // FEWEST_PLANES
    fits = (n for n in range(1, most + 1) if largest_bytes(scan, settings.changed(blocks=n)) <= limit)
    return next(fits, 1)


def largest_bytes(scan: Summary, settings: Settings) -> int:
    """Memory of the largest task that traces rays or updates the image, bytes."""
    return max(size.bytes for size in ray_task_sizes(scan, settings).values())

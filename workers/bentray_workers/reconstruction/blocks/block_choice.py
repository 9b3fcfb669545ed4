"""Whether a volume is reconstructed in blocks, and in how many: the fewest whose tasks fit a worker."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from distributed import Client
from distributed.system import MEMORY_LIMIT

from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.solver_choice import undivided_reason

from ...cluster.capacities import WorkerCapacity, capacities_of
from ...files.atomic import write_bytes
from ...files.dataset.counts import Summary
from ...files.dataset.summary import counts_in
from ..memory.ray_memory import ray_task_parts, shape_of

# Planes of a block, at least: with fewer most of a task would be planes of its neighbours.
FEWEST_PLANES = 8

# In the folder of the job.
DECISION = "block-count"


def with_blocks(scan: Summary, settings: Settings, capacities: Sequence[WorkerCapacity]) -> Settings:
    """The settings with the number of blocks of a volume whose arrays fit no worker; else as they are.

    Args:
        scan: the dataset.
        settings: with nodes and decomposition.
        capacities: of workers with the needed resource; without any, no limit is known.
    """
    if settings.numerics.blocks > 1 or undivided_reason(settings, amplitudes=scan.amplitudes):
        return settings
    limit = max((one.task_bytes for one in capacities), default=math.inf)
    most = shape_of(scan, settings)[0] // FEWEST_PLANES
    for blocks in range(1, most + 1):
        divided = settings.changed(blocks=blocks) if blocks > 1 else settings
        if largest_bytes(scan, divided) <= limit:
            return divided
    return settings


def largest_bytes(scan: Summary, settings: Settings) -> int:
    """Memory of the largest task that traces rays or updates the image, bytes."""
    return max(sum(parts.values()) for parts in ray_task_parts(scan, settings).values())


def settled_blocks(client: Client | None, folder: Path, scan: Path, settings: Settings) -> Settings:
    """The settings with the blocks of a job, decided at its start and kept when it is resumed.

    Args:
        client: of a cluster; None: threads of this process, whose limit is the memory of this machine.
        folder: of the job.
        scan: a file in the upload format.
        settings: of the job.
    """
    if settings.method != "sart" or settings.decomposition == "slices" or settings.numerics.blocks > 1:
        return settings
    known = counts_in(scan).summary(settings)
    complete = settings.changed(decomposition=settings.decomposition or known.decomposition)
    if complete.decomposition == "slices":
        return settings
    file = folder / DECISION
    if before := _read(file):
        return settings.changed(blocks=before)
    if settings.nodes is None:
        complete = complete.changed(nodes=known.nodes)
    here = (WorkerCapacity(int(MEMORY_LIMIT), ("recon",)),)
    blocks = with_blocks(known, complete, here if client is None else capacities_of(client)).numerics.blocks
    folder.mkdir(parents=True, exist_ok=True)
    write_bytes(file, str(blocks).encode())
    return settings.changed(blocks=blocks)


def _read(file: Path) -> int:
    """The decision of an earlier run; 0 without one."""
    try:
        return int(file.read_text())
    except (OSError, ValueError):
        return 0

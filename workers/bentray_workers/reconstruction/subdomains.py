"""Domain decomposition of one travel-time field: blocks on workers exchange faces until convergence.

For fields larger than the memory of a worker: slowness and times of a block never leave the workers; faces go
from block to block, and to this process only the information whether they have changed.

The loop is not that of ``cluster.task_pool``: there results come back to this process, tasks run on any
worker, and a job resumes from its checkpoint. Here results stay on the worker of their block, the next tasks
are known only when all faces of a round are compared, and Dask computes the blocks of a lost worker from the
tasks before them again. So there is neither a checkpoint nor cancellation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from distributed import Client, Future
from numpy.typing import ArrayLike

from bentray_kernels.arrays import Floats
from bentray_kernels.eikonal.problem import Node, cell_of, placed, straight_times
from bentray_kernels.eikonal.subdomains import (
    BlockSweep,
    Box,
    Place,
    cut,
    neighbours,
    opposite,
    sweep_block,
)
from bentray_kernels.errors import InvalidInput

from ..cluster.connected import connected_workers
from ..cluster.resources import RECONSTRUCTION
from ..files.npy_headers import PARSING

# A file from which workers read their blocks, or the speed itself.
Speed = Path | Floats


class Edges(NamedTuple):
    """Faces of a block for its neighbours, and which of them have changed."""

    faces: tuple[Floats, ...]
    changed: tuple[bool, ...]


@dataclass(frozen=True)
class BlockField:
    """A converged travel time with its blocks on the workers; they are freed with the last reference.

    Attributes:
        shape: (nx, ny[, nz]).
        boxes: the nodes of each block, by its position among the blocks.
        rounds: number of sweeps with exchanges of faces.
    """

    shape: tuple[int, ...]
    boxes: Mapping[Place, Box]
    rounds: int
    swept: Mapping[Place, Future]

    def block(self, place: Place) -> Floats:
        """The times of one block, s, in its own shape."""
        future = self.swept[place]
        times: Floats = future.client.submit(_times, future, resources=RECONSTRUCTION, pure=False).result()
        return times

    def whole(self) -> Floats:
        """(nx, ny[, nz]), s; fetched block by block."""
        time = np.empty(self.shape)
        for place, box in self.boxes.items():
            time[box] = self.block(place)
        return time


def solve(
    client: Client,
    speed: Path | ArrayLike,
    spacing: float,
    source: ArrayLike,
    blocks: Sequence[int],
    *,
    tolerance: float = 1e-12,
) -> Floats:
    """Travel time from a point source by fast sweeping in blocks (Zhao 2007; chapter 7.2.2).

    Args:
        client: of the cluster.
        speed: (nx, ny[, nz]), m/s, or a ``.npy`` file of it that every worker can read. Of an array each
            block is sent with its task, so that blocks of a lost worker are computed again elsewhere.
        spacing: node spacing, m.
        source: (ndim,), m, in the grid; node 0 lies at 0.
        blocks: along each axis, from 1 to the nodes there; a worker holds about three arrays of each block.
        tolerance: as for ``eikonal.fast_sweeping``, for every block.

    Returns:
        (nx, ny[, nz]), s. Equal to ``eikonal.solve(..., "fsm")`` to 1e-12 of each time.

    Raises:
        InvalidInput: for a speed, source or number of blocks that does not fit.
    """
    return solve_in_blocks(client, speed, spacing, source, blocks, tolerance=tolerance).whole()


def solve_in_blocks(
    client: Client,
    speed: Path | ArrayLike,
    spacing: float,
    source: ArrayLike,
    blocks: Sequence[int],
    *,
    tolerance: float = 1e-12,
) -> BlockField:
    """As ``solve``, but the field stays in its blocks, for grids larger than any process."""
    given: Speed = speed if isinstance(speed, Path) else np.asarray(speed, dtype=np.float64)
    array = opened(given)
    if array.ndim not in (2, 3) or array.size == 0:
        raise InvalidInput("speed", f"shape {array.shape}", "a non-empty 2-D or 3-D array")
    if not (math.isfinite(spacing) and spacing > 0.0):
        raise InvalidInput("spacing", spacing, "a finite node spacing > 0 m")
    seeds = _seeds(array, spacing, placed(source, array.shape, spacing))
    boxes = cut(array.shape, blocks)
    homes = _homes(client, list(boxes))

    def run(place: Place, function: object, *arguments: object) -> Future:
        return client.submit(
            function,
            *arguments,
            resources=RECONSTRUCTION,
            pure=False,
            workers=homes[place],
            allow_other_workers=True,
        )

    slowness = {
        place: run(place, slowness_of, given if isinstance(given, Path) else array[box], box)
        for place, box in boxes.items()
    }
    # A block around the source starts from seeds; others start with the first face that arrives.
    own = {place: _within(seeds, box) for place, box in boxes.items()}
    swept: dict[Place, Future] = {}
    held: dict[Place, list[Future | None]] = {place: [None] * (2 * array.ndim) for place in boxes}
    waiting, rounds = {place for place, found in own.items() if found}, 0
    while waiting:
        rounds += 1
        edges = {}
        for place in sorted(waiting):
            before = swept.get(place, own[place])
            swept[place] = run(place, sweep, slowness[place], before, list(held[place]), spacing, tolerance)
            edges[place] = run(place, _edges, swept[place])
        changed = {place: run(place, _changed, edge) for place, edge in edges.items()}
        changes: dict[Place, tuple[bool, ...]] = client.gather(changed)
        waiting = set()
        for place, sides in changes.items():
            for side, beyond in neighbours(place, boxes):
                if sides[side]:
                    held[beyond][opposite(side)] = run(beyond, _face, edges[place], side)
                    waiting.add(beyond)
    return BlockField(array.shape, boxes, rounds, swept)


def opened(speed: Speed) -> Floats:
    """The speed itself, or a memory map of its file.

    Raises:
        InvalidInput: for a file without an array of numbers.
    """
    if not isinstance(speed, Path):
        return speed
    try:
        with PARSING:
            mapped: Floats = np.load(speed, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError) as error:
        raise InvalidInput("speed", f"{speed} ({error})", "a .npy file of numbers") from error
    return mapped


def slowness_of(speed: Speed, box: Box) -> Floats:
    """Task: the slowness of one block, s/m, from the file of the whole or from the block's own speed.

    Raises:
        InvalidInput: for speeds that are not finite and positive, with the node in the whole grid.
    """
    part = np.asarray(opened(speed)[box] if isinstance(speed, Path) else speed, dtype=np.float64)
    # NaN fails the first comparison.
    if not (part.min() > 0.0 and part.max() < math.inf):
        inside = tuple(int(i) for i in np.argwhere(~(np.isfinite(part) & (part > 0.0)))[0])
        node = tuple(b.start + i for b, i in zip(box, inside, strict=True))
        raise InvalidInput("speed", f"{part[inside]:g} at node {node}", "finite speeds > 0 m/s")
    return np.ascontiguousarray(1.0 / part)


def sweep(
    slowness: Floats,
    before: BlockSweep | Mapping[Node, float],
    faces: list[Floats | None],
    spacing: float,
    tolerance: float,
) -> BlockSweep:
    """Task: sweep one block to convergence, from its earlier times or, at first, from the seeds in it."""
    if isinstance(before, BlockSweep):
        return sweep_block(slowness, before.times, faces, spacing, tolerance)
    times = np.full(slowness.shape, math.inf)
    for node, time in before.items():
        times[node] = time
    swept = sweep_block(slowness, times, faces, spacing, tolerance)
    # The seeds are changes for the neighbours too.
    return BlockSweep(swept.times, swept.faces, tuple(bool(np.isfinite(face).any()) for face in swept.faces))


def _edges(swept: BlockSweep) -> Edges:
    return Edges(swept.faces, swept.changed)


def _changed(edges: Edges) -> tuple[bool, ...]:
    return edges.changed


def _face(edges: Edges, side: int) -> Floats:
    return edges.faces[side]


def _times(swept: BlockSweep) -> Floats:
    return swept.times


def _seeds(speed: Floats, spacing: float, source: Floats) -> dict[Node, float]:
    """Times of the nodes around the source, s; only these nodes of the speed are read."""
    cell = cell_of(source, speed.shape, spacing)
    at_nodes = [float(speed[node]) for node, _ in cell]
    for (node, _), value in zip(cell, at_nodes, strict=True):
        if not 0.0 < value < math.inf:
            raise InvalidInput("speed", f"{value:g} at node {node}", "finite speeds > 0 m/s")
    return straight_times(cell, [1.0 / value for value in at_nodes], spacing, source)


def _within(seeds: Mapping[Node, float], box: Box) -> dict[Node, float]:
    """The seeds in a block, by their nodes in it."""
    inside = {}
    for node, time in seeds.items():
        if all(b.start <= i < b.stop for i, b in zip(node, box, strict=True)):
            inside[tuple(i - b.start for i, b in zip(node, box, strict=True))] = time
    return inside


def _homes(client: Client, places: Sequence[Place]) -> dict[Place, str]:
    """A worker for each block, in turn; its data stay there as long as the worker lives.

    Raises:
        ConnectionError: without workers.
    """
    workers = sorted(connected_workers(client))
    if not workers:
        raise ConnectionError("the cluster has no workers")
    return {place: workers[k % len(workers)] for k, place in enumerate(places)}

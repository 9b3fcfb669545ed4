"""Domain decomposition of one travel-time field: blocks on workers exchange faces until convergence.

For fields larger than the memory of a worker: slowness and times of a block never leave the workers; faces go
from block to block, and to this process only the information whether they have changed.

The loop is not that of ``cluster.task_pool``: there results come back to this process, tasks run on any
worker, and a job resumes from its checkpoint. Here results stay on the worker of their block, the next tasks
are known only when all faces of a round are compared, and Dask computes the blocks of a lost worker from the
tasks before them again. So there is neither a checkpoint nor cancellation.
"""

from __future__ import annotations

import concurrent.futures
import itertools
import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from dask.sizeof import sizeof
from distributed import Client, Future
from numpy.typing import ArrayLike

from bentray_kernels.arrays import Floats
from bentray_kernels.eikonal.problem import Node, cell_of, placed, straight_times
from bentray_kernels.eikonal.subdomains import (
    Block,
    BlockIndex,
    Box,
    Halo,
    cut,
    neighbours,
    opposite,
)
from bentray_kernels.errors import InvalidInput

from ..cluster.connected import connected_workers
from ..cluster.resources import RECONSTRUCTION
from ..files.npy_headers import PARSING

# Submits a task about a block to its worker.
Run = Callable[..., Future]

# A file from which workers read their blocks, or the speed itself.
Speed = Path | Floats


class Swept(NamedTuple):
    """Result of a sweep: the block, for later sweeps, and its halo for the neighbours."""

    block: Block
    halo: Halo | None


@sizeof.register(Block)
def _size(block: Block) -> int:
    return block.nbytes


@dataclass(frozen=True)
class BlockField:
    """A converged travel time with its blocks on the workers; they are freed with the last reference.

    Attributes:
        shape: (nx, ny[, nz]).
        boxes: the nodes of each block, by its position among the blocks.
        rounds: number of sweeps with exchanges of faces.
    """

    shape: tuple[int, ...]
    boxes: Mapping[BlockIndex, Box]
    rounds: int
    swept: Mapping[BlockIndex, Future]

    def block(self, index: BlockIndex) -> Floats:
        """The times of one block, s, in its own shape."""
        future = self.swept[index]
        times: Floats = future.client.submit(_times, future, resources=RECONSTRUCTION, pure=False).result()
        return times

    def whole(self) -> Floats:
        """(nx, ny[, nz]), s; fetched block by block."""
        time = np.empty(self.shape)
        for index, box in self.boxes.items():
            time[box] = self.block(index)
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
        blocks: along each axis, from 1 to the nodes there; a worker holds about seven arrays of each block.
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
    """Like ``solve``, but the field stays in its blocks, for grids larger than any process."""
    return next(solve_many_in_blocks(client, speed, spacing, [source], blocks, tolerance=tolerance))


def solve_many_in_blocks(
    client: Client,
    speed: Path | ArrayLike,
    spacing: float,
    sources: Iterable[ArrayLike],
    blocks: Sequence[int],
    *,
    tolerance: float = 1e-12,
    at_once: int | None = None,
) -> Iterator[BlockField]:
    """The fields of several sources, in their order.

    A front crosses the blocks one after the other, so that with one source some workers wait. With several
    sources they compute those of the others.

    Args:
        client, speed, spacing, blocks, tolerance: as for ``solve``.
        sources: (ndim,) each, m.
        at_once: fields that are computed at the same time; a worker holds about seven arrays of each of its
            blocks for each of them. None: as many as there are blocks.

    Yields:
        The converged fields; a field is kept on the workers as long as it is referenced.

    Raises:
        InvalidInput: as ``solve``; for ``at_once`` below 1.
    """
    given: Speed = speed if isinstance(speed, Path) else np.asarray(speed, dtype=np.float64)
    array = opened(given)
    if array.ndim not in (2, 3) or array.size == 0:
        raise InvalidInput("speed", f"shape {array.shape}", "a non-empty 2-D or 3-D array")
    if not (math.isfinite(spacing) and spacing > 0.0):
        raise InvalidInput("spacing", spacing, "a finite node spacing > 0 m")
    boxes = cut(array.shape, blocks)
    if at_once is not None and at_once < 1:
        raise InvalidInput("at_once", at_once, "a number of fields >= 1")
    all_seeds = (_seeds(array, spacing, placed(source, array.shape, spacing)) for source in sources)
    homes = _homes(client, list(boxes))

    def run(index: BlockIndex, function: object, *arguments: object) -> Future:
        return client.submit(
            function,
            *arguments,
            resources=RECONSTRUCTION,
            pure=False,
            workers=homes[index],
            allow_other_workers=True,
        )

    slowness = {
        index: run(index, slowness_of, given if isinstance(given, Path) else array[box], box)
        for index, box in boxes.items()
    }

    def solved(seeds: Mapping[Node, float]) -> BlockField:
        swept = {
            index: run(index, begin, slowness[index], spacing, _within(seeds, box))
            for index, box in boxes.items()
        }
        rounds = _exchange(
            client, run, swept, {index for index, box in boxes.items() if _within(seeds, box)}, tolerance
        )
        return BlockField(array.shape, boxes, rounds, swept)

    most = at_once or len(boxes)
    with ThreadPoolExecutor(most, "blocks") as pool:
        running: deque[concurrent.futures.Future[BlockField]] = deque()
        for seeds in all_seeds:
            running.append(pool.submit(solved, seeds))
            if len(running) == most:
                yield running.popleft().result()
        while running:
            yield running.popleft().result()


def _exchange(
    client: Client, run: Run, swept: dict[BlockIndex, Future], waiting: set[BlockIndex], tolerance: float
) -> int:
    """Sweep the waiting blocks and give their changed faces to their neighbours, until none has changed.

    Returns:
        The number of rounds; ``swept`` holds the results of the last sweeps.
    """
    axes = len(next(iter(swept)))
    arrived: dict[BlockIndex, list[Future | None]] = {index: [None] * (2 * axes) for index in swept}
    for rounds in itertools.count():
        if not waiting:
            return rounds
        changed = {}
        for index in sorted(waiting):
            swept[index] = run(index, sweep, swept[index], arrived[index], tolerance)
            arrived[index] = [None] * (2 * axes)
            changed[index] = run(index, _changed, swept[index])
        waiting = set()
        for index, sides in client.gather(changed).items():
            for side, beyond in neighbours(index, swept):
                if sides[side]:
                    arrived[beyond][opposite(side)] = run(index, _face, swept[index], side)
                    waiting.add(beyond)
    raise AssertionError


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
    values = np.asarray(opened(speed)[box] if isinstance(speed, Path) else speed, dtype=np.float64)
    # NaN fails the first comparison.
    if not (values.min() > 0.0 and values.max() < math.inf):
        inside = tuple(int(i) for i in np.argwhere(~(np.isfinite(values) & (values > 0.0)))[0])
        node = tuple(b.start + i for b, i in zip(box, inside, strict=True))
        raise InvalidInput("speed", f"{values[inside]:g} at node {node}", "finite speeds > 0 m/s")
    return np.ascontiguousarray(1.0 / values)


def begin(slowness: Floats, spacing: float, seeds: Mapping[Node, float]) -> Swept:
    """Task: a block before its first sweep."""
    return Swept(Block(slowness, spacing, seeds), None)


def sweep(before: Swept, faces: list[Floats | None], tolerance: float) -> Swept:
    """Task: sweep one block until its times have converged.

    It lowers the times of ``before`` in place, and its result is the same when Dask runs it again.
    """
    return Swept(before.block, before.block.sweep(faces, before.halo, tolerance))


def _changed(swept: Swept) -> tuple[bool, ...]:
    assert swept.halo is not None
    return swept.halo.changed


def _face(swept: Swept, side: int) -> Floats:
    assert swept.halo is not None
    return swept.halo.faces[side]


def _times(swept: Swept) -> Floats:
    return swept.block.times()


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


def _homes(client: Client, indices: Sequence[BlockIndex]) -> dict[BlockIndex, str]:
    """A worker for each block, in turn; its data stay there as long as the worker lives.

    Raises:
        ConnectionError: without workers.
    """
    workers = sorted(connected_workers(client))
    if not workers:
        raise ConnectionError("the cluster has no workers")
    return {index: workers[k % len(workers)] for k, index in enumerate(indices)}

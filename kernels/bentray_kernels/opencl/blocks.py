"""Fast iterative travel times on an OpenCL device: blocks of points, many problems per launch."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from ..arrays import Floats, Ints
from .program import Program
from .session import Session

# Points along a side of a block, by dimensions of the grid; 64 points either way.
EDGES = {2: 8, 3: 4}

# The nodes of one problem's source, flat and C-ordered, and their travel times, s.
Seeds = tuple[Ints, Floats]


def travel_times(
    session: Session, crossings: Floats, seeds: Sequence[Seeds], tolerance: float = 1e-12
) -> Floats:
    """First-order travel times of a batch of point sources.

    Args:
        session: the device.
        crossings: (batch, nx, ny[, nz]), spacing times slowness, s; a batch of 1 serves all sources.
        seeds: where each problem's front starts.
        tolerance: a decrease below this fraction of a point's crossing time counts as converged.

    Returns:
        (len(seeds), nx, ny[, nz]), s. A problem's times do not depend on the rest of its batch.
    """
    shape = crossings.shape[1:]
    blocks = Blocks(shape)
    shared = len(crossings) == 1
    times = np.empty((len(seeds), *shape))
    at_once = max(1, session.doubles_at_once() // blocks.points)
    for start in range(0, len(seeds), at_once):
        batch = slice(start, start + at_once)
        fields = crossings if shared else crossings[batch]
        times[batch] = _advance_until_settled(session, blocks, fields, seeds[batch], tolerance)
    return times


def _program(ndim: int) -> Program:
    return Program(("fast_iterative",), (f"DIMS={ndim}", f"EDGE={EDGES[ndim]}"))


class Blocks:
    """A grid cut into cubes (squares) of ``EDGES`` points, those beyond its far faces filled up.

    Attributes:
        edge: points along a side of a block.
        counts: blocks along each axis.
        number: blocks of the grid.
        points: points of all blocks.
    """

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.shape = shape
        self.edge = EDGES[len(shape)]
        self.counts = tuple(-(-n // self.edge) for n in shape)
        self.number = math.prod(self.counts)
        self.points = self.number * self.edge ** len(shape)

    def cut(self, grids: Floats) -> Floats:
        """(batch, nx, ny[, nz]) to (batch, blocks, points of a block), infinite off the grid."""
        full: Floats = np.full((len(grids), *(n * self.edge for n in self.counts)), math.inf)
        full[(slice(None), *(slice(n) for n in self.shape))] = grids
        split = full.reshape(len(grids), *(k for n in self.counts for k in (n, self.edge)))
        axes = range(len(self.shape))
        order = (0, *(1 + 2 * a for a in axes), *(2 + 2 * a for a in axes))
        return np.ascontiguousarray(split.transpose(order)).reshape(len(grids), self.number, -1)

    def join(self, blocks: Floats) -> Floats:
        """The inverse of ``cut``."""
        ndim = len(self.shape)
        split = blocks.reshape(len(blocks), *self.counts, *(self.edge,) * ndim)
        order = (0, *(k for a in range(ndim) for k in (1 + a, 1 + ndim + a)))
        full = split.transpose(order).reshape(len(blocks), *(n * self.edge for n in self.counts))
        return full[(slice(None), *(slice(n) for n in self.shape))]

    def around(self, nodes: Ints) -> Iterator[tuple[int, ...]]:
        """Places, in blocks, of the blocks that hold the nodes and of their neighbours; with repeats."""
        for node in np.stack(np.unravel_index(nodes, self.shape), axis=1):
            home = tuple(int(i) // self.edge for i in node)
            yield home
            for axis, here in enumerate(home):
                for there in (here - 1, here + 1):
                    if 0 <= there < self.counts[axis]:
                        yield (*home[:axis], there, *home[axis + 1 :])


def _advance_until_settled(
    session: Session, blocks: Blocks, crossings: Floats, seeds: Sequence[Seeds], tolerance: float
) -> Floats:
    start = np.full((len(seeds), math.prod(blocks.shape)), math.inf)
    # Each problem begins with the colour of its own source, so that its times do not depend on the others.
    lists: tuple[set[int], set[int]] = set(), set()
    for k, (nodes, values) in enumerate(seeds):
        start[k, nodes] = values
        indices = list(blocks.around(nodes))
        for index in indices:
            entry = k * blocks.number + int(np.ravel_multi_index(index, blocks.counts))
            lists[(sum(index) - sum(indices[0])) % 2].add(entry)
    cut = blocks.cut(start.reshape(len(seeds), *blocks.shape))
    queued = np.zeros(len(seeds) * blocks.number, np.int32)
    counts = np.array([len(lists[0]), len(lists[1]), 0], np.uint32)
    waiting = np.zeros((2, queued.size), np.uint32)
    for row, listed in zip(waiting, lists, strict=True):
        row[: len(listed)] = sorted(listed)
        queued[list(listed)] = 1
    ndim = len(blocks.shape)
    kernel = session.kernel(_program(ndim), "advance")
    group = (blocks.edge,) * ndim
    sides = (*blocks.counts, 1)[:3]
    with session.lock:
        times = session.upload(cut)
        fields = session.upload(blocks.cut(crossings))
        flags, lengths = session.upload(queued), session.upload(counts)
        queues = [session.upload(row) for row in waiting]
        step = 0
        kernel.set(
            times=times, crossings=fields, queued=flags, counts=lengths, tolerance=np.float64(tolerance)
        )
        blocks_x, blocks_y, blocks_z, shared = map(np.uint32, (*sides, len(crossings) == 1))
        kernel.set(blocks_x=blocks_x, blocks_y=blocks_y, blocks_z=blocks_z, shared=shared)
        length = counts[:1]
        while length[0] > 0:
            kernel.set(active=queues[step % 2], following=queues[(step + 1) % 2], step=np.uint32(step))
            session.launch(kernel, (int(length[0]) * blocks.edge, *group[1:]), group)
            step += 1
            session.download(length, lengths, 4 * (step % 3))
        session.download(cut, times)
    return blocks.join(cut)

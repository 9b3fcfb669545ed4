"""The rays of one emitter through the blocks: where each waits, and the sums over its parts."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bentray_kernels.arrays import Floats, Ints
from bentray_kernels.rays.block_tracing import WaitingRays
from bentray_kernels.rays.descent import ARRIVED, CAUGHT

from .block_files import BlockFiles
from .block_tasks import BackProjected, TracedParts


class _Part(NamedTuple):
    """Parts of some rays in a block: the file of their points, and the attempt at each of them."""

    points: str
    rays: Ints
    starts: Ints
    attempts: Ints


class RaysInBlocks:
    """From the receivers to the source. A ray that is caught begins again, from node to lowest neighbour.

    Rays run towards the block of the source. So the outermost blocks with rays come first on either side,
    the block of the source last, and each is visited about once.

    Args:
        files: of the volume.
        receivers: (rays, 3), nodes.
        source: (3,), nodes.
        curved: whether rays go from block to block; straight ones are known in all blocks at once.
        name: of the files of points, for this emitter.
    """

    def __init__(
        self, files: BlockFiles, receivers: Floats, source: Floats, *, curved: bool, name: str
    ) -> None:
        self._files, self._receivers, self._curved, self._name = files, receivers, curved, name
        self._source_block = files.block_of(float(source[0]))
        rays = len(receivers)
        self._positions = receivers.copy()
        self._counts = np.ones(rays, np.int64)
        self._by_nodes = np.zeros(rays, np.bool_)
        self._blocks = np.array([files.block_of(float(x)) for x in receivers[:, 0]], np.int64)
        self._waiting = np.ones(rays, np.bool_)
        self._parts: dict[int, list[_Part]] = {}
        self._visits = 0
        self.predicted, self.lengths = np.zeros(rays), np.zeros(rays)

    def next_blocks(self) -> list[int]:
        """The blocks to be visited now; none at the end."""
        if not self._waiting.any():
            return []
        if not self._curved:
            return list(range(self._files.blocks))
        blocks = self._blocks[self._waiting]
        below, above = blocks[blocks < self._source_block], blocks[blocks > self._source_block]
        outer = [int(below.min())] if below.size else []
        outer += [int(above.max())] if above.size else []
        return outer or [self._source_block]

    def visit(self, block: int) -> tuple[WaitingRays, Ints, str]:
        """The rays that continue in a block, their numbers, and a name for the file of their points."""
        self._visits += 1
        numbers = np.flatnonzero(self._waiting & ((self._blocks == block) | (not self._curved)))
        rays = WaitingRays(self._positions[numbers], self._counts[numbers], self._by_nodes[numbers])
        return rays, numbers, f"{self._name}-points-{self._visits:04d}"

    def visited(self, block: int, numbers: Ints, points: str, traced: TracedParts) -> None:
        """Take the result of a visit.

        Args:
            block, numbers, points: as of ``visit``.
            traced: the parts of these rays.
        """
        attempts = self._by_nodes[numbers].astype(np.int64)
        self._parts.setdefault(block, []).append(_Part(points, numbers, traced.starts, attempts))
        self.predicted[numbers] += traced.predicted
        self.lengths[numbers] += traced.lengths
        if not self._curved:
            self._waiting[:] = False
            return
        self._positions[numbers] = traced.places
        self._counts[numbers] += np.diff(traced.starts) - 1
        self._waiting[numbers[traced.ends == ARRIVED]] = False
        caught = numbers[traced.ends == CAUGHT]
        self._by_nodes[caught], self._counts[caught] = True, 1
        self._positions[caught] = self._receivers[caught]
        self.predicted[caught] = self.lengths[caught] = 0.0
        for ray in numbers:
            self._blocks[ray] = self._files.block_of(float(self._positions[ray, 0]))

    def back_projected(self, corrections: Floats) -> dict[int, list[BackProjected]]:
        """The parts by block, in the order of the visits.

        Args:
            corrections: (rays,), residual over length, s per node.
        """
        by_block: dict[int, list[BackProjected]] = {}
        for block, paths in sorted(self._parts.items()):
            for path in paths:
                last = path.attempts == self._by_nodes[path.rays]
                valid = np.where(last, corrections[path.rays], np.nan)
                by_block.setdefault(block, []).append(BackProjected(path.points, path.starts, valid))
        return by_block


def in_nodes(places_m: Floats, spacing: float, shape: Sequence[int]) -> Floats:
    """Places in nodes, clipped to the grid within rounding."""
    return np.clip(places_m / spacing, 0.0, np.array(shape) - 1.0)

"""Task graph of SART of a volume in blocks: one emitter after the other, each over all blocks."""

from collections.abc import Generator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bentray_kernels.arrays import Floats
from bentray_kernels.eikonal.problem import cell_of, placed, straight_times
from bentray_kernels.errors import InvalidInput
from bentray_kernels.task_graph import Task
from bentray_kernels.tomography.result import Iteration, residual_counts
from bentray_kernels.tomography.sart.sart_step import BlockCheckpoint, State, advanced, batch_of, begin
from bentray_kernels.tomography.sart.sart_update import valid_receivers
from bentray_kernels.tomography.scan import Scan
from bentray_kernels.tomography.solver_choice import undivided_reason

from .block_files import COVERAGE, SLOWNESS, BlockFiles, write_first
from .block_rays import RaysInBlocks, in_nodes
from .block_tasks import (
    SweepOrder,
    back_project_in_block,
    sweep_block,
    trace_rays_in_block,
    update_block,
)

# Tasks that can run at the same time, then their results in the same order.
Rounds = Generator[list[Task], list[Any], None]


class BlockSartGraph:
    """SART of one volume in ``settings.numerics.blocks`` blocks; the images are never whole in a worker.

    Equal to ``ReconstructionGraph`` with the same Eikonal solver up to rounding. See
    ``stage_graphs.SartStage``.

    Args:
        scan: of one stage.
        index: of the problem.
        folder: for the files of blocks, of this graph alone.

    Raises:
        InvalidInput: for settings whose volume is not computed in blocks.
    """

    def __init__(self, scan: Scan, index: int, folder: Path) -> None:
        self._settings = scan.stages()[-1]
        self._problem, self._index = scan.problem(index), index
        amplitudes = self._problem.log_ratio is not None
        reason = undivided_reason(self._settings, amplitudes=amplitudes)
        reason = reason or ("coarser grids" if len(scan.stages()) > 1 else "")
        if reason:
            raise InvalidInput("blocks", self._settings.numerics.blocks, f"1, with {reason}")
        shape = self._problem.region.shape
        self._files = BlockFiles(folder, shape, min(self._settings.numerics.blocks, shape[0]))
        self._state = begin(np.empty((0,) * len(shape)))
        self._updates = 0
        self._round: list[Task] = []
        self._results: dict[int, Any] = {}
        self._rounds: Rounds | None = None
        self._emitters = len(self._problem.active_emitters)

    @property
    def total(self) -> int:
        """See ``stage_graphs.Stage``."""
        return self.done if self._state.done else self._emitters * self._settings.iterations

    @property
    def done(self) -> int:
        """See ``stage_graphs.Stage``."""
        return self._emitters * self._state.iteration + self._state.emitter

    @property
    def history(self) -> tuple[Iteration, ...]:
        return self._state.history

    @property
    def state(self) -> State:
        """With the images, read from their files."""
        folder = self._files.state(self._updates)
        images = (self._files.read(folder, name) for name in (SLOWNESS, COVERAGE))
        slowness, coverage = images
        return replace(self._state, slowness=slowness, coverage=coverage)

    def value_of(self, _evaluate: Any) -> None:
        """Like ``ReconstructionGraph``: nothing is evaluated after the last iteration."""
        return

    @property
    def checkpoint(self) -> BlockCheckpoint:
        grid = self._files.shape[0], self._problem.spacing, self._problem.origin
        return BlockCheckpoint(self._state, self._updates, self._files.blocks, *grid)

    def restore(self, checkpoint: BlockCheckpoint) -> None:
        """Like ``task_graph.ResumableGraph``; from the start if the files are gone or of other blocks."""
        if checkpoint.blocks == self._files.blocks and self._files.complete(checkpoint.updates):
            self._state, self._updates = checkpoint.state, checkpoint.updates

    def first(self) -> list[Task]:
        """See ``task_graph.TaskGraph``."""
        if self._state.done:
            return []
        if not self._updates:
            write_first(self._files, 1.0 / self._problem.water_speed, self._problem.region)
        self._rounds = self._all_updates()
        return self._begin(next(self._rounds))

    def after(self, task: Task, result: Any) -> list[Task]:
        """Like ``task_graph.TaskGraph``: the tasks of a round follow when all of the last one are there."""
        assert self._rounds is not None
        self._results[next(k for k, started in enumerate(self._round) if started is task)] = result
        if len(self._results) < len(self._round):
            return []
        # In their order, not that of completion: the bits of sums depend on it.
        results = [self._results[k] for k in range(len(self._round))]
        try:
            return self._begin(self._rounds.send(results))
        except StopIteration:
            return []

    def _begin(self, tasks: list[Task]) -> list[Task]:
        self._round, self._results = tasks, {}
        return list(tasks)

    def _all_updates(self) -> Rounds:
        files, settings, problem = self._files, self._settings, self._problem
        while not self._state.done:
            state, update = self._state, self._updates
            files.begin(update)
            batch = batch_of(problem, settings, state, 1, self._index)
            residuals, sums = [], []
            for number, emitter in enumerate(batch):
                name = f"{number:04d}"
                residual, blocks = yield from self._emitter(name, int(emitter))
                residuals.append(residual)
                sums.append((name, blocks))
            common = problem.spacing, sums, settings, state.emitter == 0
            yield [Task(update_block, (files, update, block, *common)) for block in range(files.blocks)]
            squares = state.squares + float(sum((residual * residual).sum() for residual in residuals))
            counts = residual_counts(np.concatenate(residuals))
            images = state.slowness, state.coverage
            self._state = advanced(problem, settings, state, len(batch), images, squares, counts, self._index)
            self._updates += 1
            files.finish(update)

    def _emitter(self, name: str, emitter: int) -> Generator[list[Task], list[Any], tuple[Floats, list[int]]]:
        """Travel time, rays and back-projection; returns the residuals, s, and the blocks with rays."""
        files, problem, update = self._files, self._problem, self._updates
        source, receivers, measured = valid_receivers(problem, emitter)
        curved = self._settings.rays == "curved"
        versions: list[str] = []
        if curved:
            versions = yield from self._travel_time(name, source)
        at_source = in_nodes(source, problem.spacing, files.shape)
        positions = in_nodes(receivers, problem.spacing, files.shape)
        rays = RaysInBlocks(files, positions, at_source, curved=curved, name=name)
        while blocks := rays.next_blocks():
            visits = [(block, *rays.visit(block)) for block in blocks]
            traced = yield [
                Task(
                    trace_rays_in_block,
                    (files, update, block, problem.spacing, versions, at_source, waiting, points),
                )
                for block, waiting, _, points in visits
            ]
            for (block, _, numbers, points), paths in zip(visits, traced, strict=True):
                rays.visited(block, numbers, points, paths)
        residual = measured - rays.predicted
        passes = rays.lengths > 0.0
        corrections = np.divide(residual, rays.lengths, out=np.full(len(residual), np.nan), where=passes)
        projected = rays.back_projected(corrections)
        yield [
            Task(back_project_in_block, (files, update, block, parts, name))
            for block, parts in projected.items()
        ]
        return residual, list(projected)

    def _travel_time(self, name: str, source: Floats) -> Generator[list[Task], list[Any], list[str]]:
        """Sweep blocks and exchange faces until none has changed; returns the last version of each block."""
        files, spacing, update = self._files, self._problem.spacing, self._updates
        seeds = self._seeds(source)
        versions: list[str | None] = [None] * files.blocks
        beyond: dict[int, list[str | None]] = {block: [None, None] for block, own in enumerate(seeds) if own}
        turn = 0
        while beyond:
            turn += 1
            orders = {
                block: SweepOrder(
                    seeds[block], f"{name}-times-{turn:04d}", versions[block], (faces[0], faces[1])
                )
                for block, faces in sorted(beyond.items())
            }
            changed = yield [
                Task(sweep_block, (files, update, block, spacing, order)) for block, order in orders.items()
            ]
            for block, order in orders.items():
                versions[block] = order.version
            beyond = {}
            for block, (below, above) in zip(orders, changed, strict=True):
                if below and block > 0:
                    beyond.setdefault(block - 1, [None, None])[1] = versions[block]
                if above and block + 1 < files.blocks:
                    beyond.setdefault(block + 1, [None, None])[0] = versions[block]
        return [version for version in versions if version is not None]

    def _seeds(self, source: Floats) -> list[dict[tuple[int, ...], float]]:
        """Times of the nodes around the source, s, by their positions in each block."""
        files, spacing = self._files, self._problem.spacing
        cell = cell_of(placed(source, files.shape, spacing), files.shape, spacing)
        folder = files.state(self._updates)
        at_nodes = []
        for (i, *rest), _ in cell:
            plane = files.read(folder, SLOWNESS, i, i + 1)[0]
            at_nodes.append(1.0 / (1.0 / float(plane[tuple(rest)])))
        seeds: list[dict[tuple[int, ...], float]] = [{} for _ in range(files.blocks)]
        for (i, *rest), time in straight_times(cell, at_nodes, spacing, source).items():
            block = files.block_of(i)
            seeds[block][(i - files.bounds(block)[0], *rest)] = time
        return seeds

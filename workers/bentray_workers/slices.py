"""Slice-decomposed reconstruction: each slice is a chain of short tasks, a batch of emitters each."""

from __future__ import annotations

import tempfile
import time
from collections import deque
from collections.abc import Callable
from contextlib import nullcontext
from functools import lru_cache
from pathlib import Path

from distributed import Client, Future, wait

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.picking import pick
from bentray_kernels.tomography import (
    Progress,
    Reconstruction,
    Settings,
    SliceProblem,
    State,
    advance,
    begin,
)
from bentray_kernels.tomography import (
    reconstruct as reconstruct_here,
)
from bentray_kernels.tomography.reconstruction import assemble, measure

from .dataset_file import read_dataset, write_dataset
from .lanes import RECONSTRUCTION

# Long enough that scheduling costs nothing, short enough to show progress and to stop soon.
TASK_S = 0.5
FIRST_BATCH = 8

# Tasks in flight for each worker: one at work and one ready.
IN_FLIGHT = 2

POLL_S = 0.2


class Cancelled(Exception):  # noqa: N818 - the word that users and states have for it
    """The caller asked to stop; what was done is dropped."""


def reconstruct(
    client: Client | None,
    dataset_path: Path,
    settings: Settings,
    on_progress: Callable[[Progress], None] | None = None,
    stop: Callable[[], bool] | None = None,
    work_dir: Path | None = None,
) -> Reconstruction:
    """Reconstruct a dataset file, on a cluster or in this process; both give the same bits.

    Tasks get the file's path, never its arrays: a lost worker then costs one batch of emitters. The
    state of each slice comes back after every batch, so that the loop can report, stop and go on.

    Args:
        client: of the cluster; None works in this process.
        dataset_path: a file in the upload format, readable by every worker.
        settings: see ``Settings``.
        on_progress: called after each batch.
        stop: polled between batches, and while a cluster picks; true ends with ``Cancelled``.
        work_dir: where picked travel times are kept while it runs, readable by every worker; None: a
            temporary folder of this machine.

    Raises:
        Cancelled: when ``stop`` said so.
        InvalidInput: from the file or the settings.
    """
    if client is None:
        return _reconstruct_here(dataset_path, settings, on_progress, stop)
    with _folder(work_dir) as folder:
        path = _prepared(client, dataset_path, settings, Path(folder), stop)
        return _drive(client, path, settings, on_progress, stop)


def _prepared(
    client: Client, dataset_path: Path, settings: Settings, folder: Path, stop: Callable[[], bool] | None
) -> Path:
    """What ``prepare`` gives; picking may take a while, and a stop does not wait for its end."""
    picking = client.submit(prepare, dataset_path, settings, folder, resources=RECONSTRUCTION, pure=False)
    while not _finished(client, [picking]):
        if stop is not None and stop():
            picking.cancel()
            raise Cancelled
    path: Path = picking.result()
    return path


def prepare(dataset_path: Path, settings: Settings, folder: Path) -> Path:
    """Task: a file with travel times, which is the dataset itself unless they must be picked first."""
    dataset = read_dataset(dataset_path)
    if dataset.picked:
        return dataset_path
    picked = folder / "picked.h5"
    write_dataset(picked, pick(dataset, settings.picker))
    return picked


def advance_slice(
    path: Path, stamp: int, settings: Settings, index: int, state: State | None, emitters: int
) -> tuple[State, float]:
    """Task: use more emitters of one slice; returns the new state and the seconds it took."""
    problem = _problem(path, stamp, settings, index)
    start = time.perf_counter()
    state = advance(problem, settings, begin(problem) if state is None else state, emitters, index)
    return state, time.perf_counter() - start


@lru_cache(maxsize=8)
def _problem(path: Path, stamp: int, settings: Settings, index: int) -> SliceProblem:
    """One slice's problem, read once a process; ``stamp`` tells a rewritten file from the old one."""
    return SliceProblem.of(_dataset(path, stamp), settings, index)


@lru_cache(maxsize=2)
def _dataset(path: Path, stamp: int) -> Dataset:
    return read_dataset(path, traces=False)


def _drive(
    client: Client,
    path: Path,
    settings: Settings,
    on_progress: Callable[[Progress], None] | None,
    stop: Callable[[], bool] | None,
) -> Reconstruction:
    stamp = path.stat().st_mtime_ns
    dataset = read_dataset(path, traces=False)
    problems = [SliceProblem.of(dataset, settings, k) for k in range(dataset.slices)]
    states = [begin(problem) for problem in problems]
    ready = deque((k, FIRST_BATCH) for k in range(dataset.slices))
    running: dict[Future, tuple[int, int]] = {}
    window = IN_FLIGHT * max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
    try:
        while ready or running:
            while ready and len(running) < window:
                k, batch = ready.popleft()
                future = client.submit(
                    advance_slice,
                    path,
                    stamp,
                    settings,
                    k,
                    states[k],
                    batch,
                    resources=RECONSTRUCTION,
                    pure=False,
                )
                running[future] = (k, batch)
            for future in _finished(client, list(running)):
                k, batch = running.pop(future)
                before = states[k]
                states[k], seconds = future.result()
                if not states[k].done:
                    ready.append((k, _next_batch(batch, before, states[k], seconds)))
                if on_progress is not None:
                    on_progress(measure(problems, settings, states))
            if stop is not None and stop():
                raise Cancelled
    finally:
        for future in running:
            future.cancel()
    return assemble(dataset, settings, problems, states)


def _finished(client: Client, running: list[Future]) -> list[Future]:
    # The client is nobody's default, so ``wait`` must be told which it is.
    with client.as_current():
        try:
            return list(wait(running, timeout=POLL_S, return_when="FIRST_COMPLETED").done)
        except TimeoutError:
            return []


def _next_batch(batch: int, before: State, after: State, seconds: float) -> int:
    """Emitters that take about ``TASK_S``; a batch that ended with its sweep tells too little."""
    used = after.emitter - before.emitter
    if used != batch or seconds <= 0.0:
        return batch
    return max(1, min(4 * batch, int(batch * TASK_S / seconds)))


def _reconstruct_here(
    dataset_path: Path,
    settings: Settings,
    on_progress: Callable[[Progress], None] | None,
    stop: Callable[[], bool] | None,
) -> Reconstruction:
    dataset = read_dataset(dataset_path)
    if not dataset.picked:
        dataset = pick(dataset, settings.picker)

    def report(progress: Progress) -> None:
        if on_progress is not None:
            on_progress(progress)
        if stop is not None and stop():
            raise Cancelled

    return reconstruct_here(dataset, settings, report)


def _folder(work_dir: Path | None):  # type: ignore[no-untyped-def]
    return tempfile.TemporaryDirectory() if work_dir is None else nullcontext(work_dir)

"""Reconstruction on a cluster: each slice, or the volume, is a chain of short tasks."""

from __future__ import annotations

import tempfile
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace
from itertools import count
from pathlib import Path

from distributed import Client, Future, wait

from bentray_kernels.acquisition.picking import pick
from bentray_kernels.tomography import Progress, Reconstruction, Settings
from bentray_kernels.tomography import (
    reconstruct as reconstruct_here,
)
from bentray_kernels.tomography.chains import Call, Calls
from bentray_kernels.tomography.reconstruction import carried_out, measured

from .attempts import Attempts
from .checkpoints import Checkpoints
from .dataset_file import read_dataset, write_dataset
from .offers import resources_for
from .scan import FileScan, FileWaveScan
from .trace_reading import trace_samples

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
    on_saved: Callable[[], None] = lambda: None,
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
        work_dir: where picked travel times and checkpoints are kept, readable by every worker; one that an
            unfinished run of the same dataset and settings left is gone on from, to the same bits. None: a
            temporary folder of this machine.
        on_saved: called after each checkpoint.

    Raises:
        Cancelled: when ``stop`` said so.
        InvalidInput: from the file or the settings, and for a device that no worker offers.
    """
    if client is None:
        return _reconstruct_here(dataset_path, settings, on_progress, stop)
    with _folder(work_dir) as folder:
        attempts = Attempts(client, folder, resources_for(client, settings))
        path = _prepared(client, attempts, dataset_path, settings, folder, stop)
        checkpoints = Checkpoints(folder / "checkpoints", on_saved)
        return _carried_out(client, attempts, path, dataset_path, settings, checkpoints, on_progress, stop)


def _prepared(
    client: Client,
    attempts: Attempts,
    dataset_path: Path,
    settings: Settings,
    folder: Path,
    stop: Callable[[], bool] | None,
) -> Path:
    """What ``prepare`` gives; picking may take a while, and a stop does not wait for its end."""
    picking: Future | None = attempts.submit(prepare, dataset_path, settings, folder)
    path: Path | None = None
    while picking is not None:
        while not finished(client, [picking]):
            if stop is not None and stop():
                picking.cancel()
                raise Cancelled
        picking, path = attempts.ended(picking)
    assert path is not None
    return path


def prepare(dataset_path: Path, settings: Settings, folder: Path) -> Path:
    """Task: a file with travel times, which is the dataset itself unless they must be picked first."""
    picked = folder / "picked.h5"
    if picked.exists():
        return picked
    dataset = read_dataset(dataset_path)
    if dataset.picked:
        return dataset_path
    write_dataset(picked, pick(dataset, settings.picker))
    return picked


def _carried_out(
    client: Client,
    attempts: Attempts,
    path: Path,
    traces: Path,
    settings: Settings,
    checkpoints: Checkpoints,
    on_progress: Callable[[Progress], None] | None,
    stop: Callable[[], bool] | None,
) -> Reconstruction:
    stamp = path.stat().st_mtime_ns
    drives = count()

    def drive(chains: Sequence[Calls], before: int, after: int) -> None:
        # What is driven first, as the trials of ``auto``, is restored as a whole and so decides as it did.
        number = next(drives)
        named = {f"{number}-{k:05d}": chain for k, chain in enumerate(chains)}
        for name, chain in named.items():
            standing = checkpoints.last(name)
            if standing is not None:
                chain.restore(standing)
        _drive(client, attempts, named, before, after, checkpoints, on_progress, stop)

    return carried_out(
        read_dataset(path, traces=False),
        settings,
        lambda plan, part: FileScan(path, stamp, plan, part),
        drive,
        lambda plan, index: FileWaveScan(traces, traces.stat().st_mtime_ns, plan, index),
        trace_samples(traces),
    )


def _drive(
    client: Client,
    attempts: Attempts,
    chains: Mapping[str, Calls],
    before: int,
    after: int,
    checkpoints: Checkpoints,
    on_progress: Callable[[Progress], None] | None,
    stop: Callable[[], bool] | None,
) -> None:
    """Run chains, each with its name among the checkpoints, to their end, a few calls at a time."""
    ready = deque((name, call) for name, chain in chains.items() for call in chain.first())
    running: dict[Future, tuple[str, Call]] = {}
    window = IN_FLIGHT * max(1, len(client.scheduler_info(n_workers=-1)["workers"]))

    def report() -> None:
        if on_progress is not None:
            on_progress(measured(list(chains.values()), before, after))

    # Chains that are restored at their end are no news where others follow: progress would seem to go back.
    if ready or not after:
        report()
    try:
        while ready or running:
            while ready and len(running) < window:
                name, call = ready.popleft()
                running[attempts.submit(call.function, *call.arguments)] = name, call
            for future in finished(client, list(running)):
                name, call = running.pop(future)
                again, given = attempts.ended(future, keep=call.keep)
                if again is not None:
                    running[again] = name, call
                    continue
                # Before other slices begin: what an iteration keeps is freed by its end.
                ready.extendleft((name, later) for later in reversed(chains[name].after(call, given)))
                checkpoints.keep(name, chains[name].standing)
                report()
            if stop is not None and stop():
                raise Cancelled
    finally:
        for future in running:
            future.cancel()


def finished(client: Client, running: list[Future]) -> list[Future]:
    """Those that have ended; waits for the first one, ``POLL_S`` at most."""
    # The client is nobody's default, so ``wait`` must be told which it is.
    with client.as_current():
        try:
            return list(wait(running, timeout=POLL_S, return_when="FIRST_COMPLETED").done)
        except TimeoutError:
            return []


def _reconstruct_here(
    dataset_path: Path,
    settings: Settings,
    on_progress: Callable[[Progress], None] | None,
    stop: Callable[[], bool] | None,
) -> Reconstruction:
    dataset = read_dataset(dataset_path)
    traces = dataset.waveform if settings.method == "waveform" else None
    if not dataset.picked:
        dataset = pick(dataset, settings.picker)
    dataset = replace(dataset, waveform=traces)

    def report(progress: Progress) -> None:
        if on_progress is not None:
            on_progress(progress)
        if stop is not None and stop():
            raise Cancelled

    return reconstruct_here(dataset, settings, report)


def _folder(work_dir: Path | None) -> AbstractContextManager[Path]:
    return _temporary_folder() if work_dir is None else nullcontext(work_dir)


@contextmanager
def _temporary_folder() -> Iterator[Path]:
    """A folder that goes at the end, under the hands of calls that were told to stop and still run."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as outer:
        folder = Path(outer) / "work"
        folder.mkdir()
        try:
            yield folder
        finally:
            # What such a call still wants to write under the old name finds no folder.
            folder.rename(folder.with_name("ended"))

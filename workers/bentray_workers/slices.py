"""Reconstruction on a cluster: each slice, or the volume, is a chain of short tasks."""

from __future__ import annotations

import tempfile
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path

from distributed import Client, Future, wait

from bentray_kernels.acquisition.picking import pick
from bentray_kernels.tomography import Progress, Reconstruction, Settings
from bentray_kernels.tomography import (
    reconstruct as reconstruct_here,
)
from bentray_kernels.tomography.chains import Call, Chain
from bentray_kernels.tomography.reconstruction import carried_out, measured

from .dataset_file import read_dataset, write_dataset
from .lanes import RECONSTRUCTION
from .scan import FileScan

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
        return _carried_out(client, path, settings, on_progress, stop)


def _prepared(
    client: Client, dataset_path: Path, settings: Settings, folder: Path, stop: Callable[[], bool] | None
) -> Path:
    """What ``prepare`` gives; picking may take a while, and a stop does not wait for its end."""
    picking = client.submit(prepare, dataset_path, settings, folder, resources=RECONSTRUCTION, pure=False)
    while not finished(client, [picking]):
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


def _carried_out(
    client: Client,
    path: Path,
    settings: Settings,
    on_progress: Callable[[Progress], None] | None,
    stop: Callable[[], bool] | None,
) -> Reconstruction:
    stamp = path.stat().st_mtime_ns

    def drive(chains: Sequence[Chain], before: int, after: int) -> None:
        _drive(client, chains, before, after, on_progress, stop)

    return carried_out(
        read_dataset(path, traces=False),
        settings,
        lambda plan, part: FileScan(path, stamp, plan, part),
        drive,
    )


def _drive(
    client: Client,
    chains: Sequence[Chain],
    before: int,
    after: int,
    on_progress: Callable[[Progress], None] | None,
    stop: Callable[[], bool] | None,
) -> None:
    """Run chains to their end, a few calls at a time."""
    ready = deque((chain, call) for chain in chains for call in chain.first())
    running: dict[Future, tuple[Chain, Call]] = {}
    window = IN_FLIGHT * max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
    try:
        while ready or running:
            while ready and len(running) < window:
                chain, call = ready.popleft()
                future = client.submit(call.function, *call.arguments, resources=RECONSTRUCTION, pure=False)
                running[future] = chain, call
            for future in finished(client, list(running)):
                chain, call = running.pop(future)
                failed = future.status != "finished"
                given = future if call.keep and not failed else future.result()
                # Before other slices begin: what an iteration keeps is freed by its end.
                ready.extendleft((chain, later) for later in reversed(chain.after(call, given)))
                if on_progress is not None:
                    on_progress(measured(chains, before, after))
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

"""Reconstruction on a cluster: each slice, or the volume, is a chain of short tasks."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import replace
from itertools import count
from pathlib import Path

from distributed import Client

from bentray_kernels.tomography import Progress, Reconstruction, Settings
from bentray_kernels.tomography.chains import Calls
from bentray_kernels.tomography.reconstruction import carried_out, measured

from .attempts import Attempts
from .checkpoints import Checkpoints
from .dataset_file import read_dataset
from .driving import IN_FLIGHT, Cancelled, Run, finished, run_here, run_on_cluster
from .findings_file import Found, read_findings
from .first_arrivals import FINDINGS, PICKED, Arrivals, Source
from .offers import resources_for
from .scan import FileScan, FileWaveScan
from .trace_reading import trace_samples

__all__ = ["IN_FLIGHT", "Cancelled", "finished", "reconstruct"]


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
        stop: polled between batches; true ends with ``Cancelled``.
        work_dir: where picked travel times and checkpoints are kept, readable by every worker; one that an
            unfinished run of the same dataset and settings left is gone on from, to the same bits. None: a
            temporary folder of this machine.
        on_saved: called after each checkpoint.

    Raises:
        Cancelled: when ``stop`` said so.
        InvalidInput: from the file or the settings, and for a device that no worker offers.
    """
    with _folder(work_dir) as folder:
        if client is None:
            run = run_here(stop)
        else:
            attempts = Attempts(client, folder, resources_for(client, settings))
            run = run_on_cluster(client, attempts, stop)
        found = _prepared(run, dataset_path, settings, folder)
        checkpoints = Checkpoints(folder / "checkpoints", on_saved)
        path = folder / PICKED if found.changed else dataset_path
        result = _carried_out(run, path, dataset_path, settings, folder, checkpoints, on_progress)
    if not settings.examine:
        return result
    told = found.words(stacked=result.speed.ndim == 3)
    return replace(result, provenance={**result.provenance, "quality": told})


def _prepared(run: Run, dataset_path: Path, settings: Settings, folder: Path) -> Found:
    """What was found in the scan, which then is ready: its times picked, its faults corrected."""
    with suppress(OSError, ValueError, KeyError):
        return read_findings(folder / FINDINGS)
    stamp = dataset_path.stat().st_mtime_ns
    source = Source(dataset_path, stamp, settings.picker, settings.examine)
    arrivals = Arrivals(source, folder)
    run([("arrivals", call) for call in arrivals.first()], {"arrivals": arrivals}, lambda name: None)
    return read_findings(folder / FINDINGS)


def _carried_out(
    run: Run,
    path: Path,
    traces: Path,
    settings: Settings,
    folder: Path,
    checkpoints: Checkpoints,
    on_progress: Callable[[Progress], None] | None,
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
        _drive(run, named, before, after, checkpoints, on_progress)

    return carried_out(
        read_dataset(path, traces=False),
        settings,
        lambda plan, part: FileScan(path, stamp, plan, part),
        drive,
        lambda plan, index: FileWaveScan(traces, traces.stat().st_mtime_ns, plan, index, folder / FINDINGS),
        trace_samples(traces),
    )


def _drive(
    run: Run,
    chains: Mapping[str, Calls],
    before: int,
    after: int,
    checkpoints: Checkpoints,
    on_progress: Callable[[Progress], None] | None,
) -> None:
    """Run chains, each with its name among the checkpoints, to their end."""
    first = [(name, call) for name, chain in chains.items() for call in chain.first()]

    def report() -> None:
        if on_progress is not None:
            on_progress(measured(list(chains.values()), before, after))

    def moved(name: str) -> None:
        checkpoints.keep(name, chains[name].standing)
        report()

    # Chains that are restored at their end are no news where others follow: progress would seem to go back.
    if first or not after:
        report()
    run(first, chains, moved)


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

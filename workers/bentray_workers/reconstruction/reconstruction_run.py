"""Reconstruction on a cluster: each slice, or the volume, is a chain of short tasks."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import NamedTuple

from distributed import Client

from bentray_kernels.tomography import Progress, Reconstruction, Settings, Trial
from bentray_kernels.tomography.guided_picking import same_picks
from bentray_kernels.tomography.reconstruct import carried_out
from bentray_kernels.tomography.task_chains import Calls, measured

from ..cluster.attempts import Attempts
from ..cluster.capacities import resources_for
from ..cluster.checkpoints import Checkpoints
from ..cluster.fair_shares import Share, alone
from ..cluster.task_loop import Cancelled, Run, finished, run_here, run_on_cluster
from ..files.dataset import read_dataset
from ..files.dataset.traces import trace_samples
from ..files.findings import Found, read_findings
from ..files.reconstruction import write_reconstruction
from .arrivals import Arrivals, Files, Guide, Source
from .file_scan import FileScan, FileWaveScan

__all__ = ["Cancelled", "finished", "reconstruct"]

# The phase of a job's progress after those of ``arrivals``.
RECONSTRUCTING = "reconstructing"


def reconstruct(
    client: Client | None,
    dataset_path: Path,
    settings: Settings,
    on_progress: Callable[[Progress], None] | None = None,
    stop: Callable[[], bool] | None = None,
    work_dir: Path | None = None,
    on_saved: Callable[[], None] = lambda: None,
    share: Share | None = None,
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
        share: of the workers; None: all of them. The bits do not depend on it.

    Raises:
        Cancelled: when ``stop`` said so.
        InvalidInput: from the file or the settings, and for a device that no worker offers.
    """
    with _folder(work_dir) as folder:
        if client is None:
            run = run_here(stop)
        else:
            attempts = Attempts(client, folder, resources_for(client, settings))
            run = run_on_cluster(client, attempts, share or alone(client, "recon"), stop)
        job = _Job(run, dataset_path, folder, Checkpoints(folder / "checkpoints", on_saved), count())
        rising = _Rising(on_progress)
        path, found, chosen, trials = _guided(job, settings, rising)
        result = _carried_out(job, path, chosen, rising)
        result = replace(result, trials=trials or result.trials)
    if not settings.examine:
        return result
    told = found.words(stacked=result.speed.ndim == 3)
    return replace(result, provenance={**result.provenance, "quality": told})


class _Job(NamedTuple):
    """What a reconstruction works with; ``drives`` numbers what it runs."""

    run: Run
    scan: Path
    folder: Path
    checkpoints: Checkpoints
    drives: Iterator[int]


def _guided(
    job: _Job, settings: Settings, rising: _Rising
) -> tuple[Path, Found, Settings, tuple[Trial, ...]]:
    """A file with travel times, and what was found in the scan: picked, and again by what images predict.

    Also how to go on: what ``auto`` chose for the first image holds for all, so that the settings of the
    result make it again.
    """
    amplitudes = settings.amplitudes if settings.listens else "recorded"
    source = Source(
        job.scan, job.scan.stat().st_mtime_ns, job.folder, settings.picker, settings.examine, amplitudes
    )
    path, found = _arrived(job, source, Files.of(job.folder), None, rising)
    rounds = 0 if source.dataset.picked else settings.guided_rounds
    rays = replace(
        settings,
        method="auto" if settings.method == "waveform" else settings.method,
        attenuation=False,
        resolution_check=False,
        wave_minutes=0.0,
    )
    trials: tuple[Trial, ...] = ()
    for number in range(1, rounds + 1):
        rising.more = 1 + rounds - number
        image = job.folder / f"{number}-image.h5"
        made = _carried_out(job, path, rays, rising)
        write_reconstruction(image, made)
        rising.step()
        if settings.method == "auto" and not trials:
            rays, trials = made.settings, made.trials
            asked = {name: getattr(settings, name) for name in ("attenuation", "resolution_check")}
            settings = replace(rays, **asked, wave_minutes=settings.wave_minutes)
        guide = Guide(image, Files.of(job.folder).findings)
        again, found_again = _arrived(job, source, Files.of(job.folder, number), guide, rising)
        if same_picks(*(read_dataset(one, traces=False) for one in (path, again))):
            break
        path, found = again, found_again
    rising.more = 0
    return path, found, settings, trials


def _arrived(
    job: _Job, source: Source, files: Files, guide: Guide | None, rising: _Rising
) -> tuple[Path, Found]:
    """What goes on after a round of picking, and what it found."""
    try:
        found = read_findings(files.findings, files.picked)
    except (OSError, ValueError, KeyError, TypeError):
        # Absent, or damaged since: they are made, or made again.
        arrivals = Arrivals(source, files, guide)
        first = [("arrivals", call) for call in arrivals.first()]
        rising.tell(arrivals.progress)
        job.run(first, {"arrivals": arrivals}, lambda name: rising.tell(arrivals.progress))
        found = read_findings(files.findings)
    return files.picked if found.changed else job.scan, found


def _carried_out(job: _Job, path: Path, settings: Settings, rising: _Rising) -> Reconstruction:
    stamp, recorded = path.stat().st_mtime_ns, job.scan.stat().st_mtime_ns
    faults = Files.of(job.folder).findings

    def drive(chains: Sequence[Calls], before: int, after: int) -> None:
        # What is driven first, as the trials of ``auto``, is restored as a whole and so decides as it did.
        number = next(job.drives)
        named = {f"{number}-{k:05d}": chain for k, chain in enumerate(chains)}
        for name, chain in named.items():
            standing = job.checkpoints.last(name)
            if standing is not None:
                chain.restore(standing)
        _drive(job.run, named, before, after, job.checkpoints, rising)

    return carried_out(
        read_dataset(path, traces=False),
        settings,
        lambda plan, part: FileScan(path, stamp, plan, part),
        drive,
        lambda plan, index: FileWaveScan(job.scan, recorded, plan, index, faults),
        trace_samples(job.scan),
    )


class _Rising:
    """The progress of reconstructions that follow each other, as of one.

    Attributes:
        more: how many may follow the present one.
    """

    def __init__(self, on_progress: Callable[[Progress], None] | None) -> None:
        self._on_progress = on_progress
        self._over = self._total = self.more = 0

    def __call__(self, progress: Progress) -> None:
        """Tell how far the present one is."""
        self._total = progress.total
        if self._on_progress is not None:
            total = self._over + progress.total * (1 + self.more)
            done = self._over + progress.done
            self._on_progress(replace(progress, done=done, total=total, phase=RECONSTRUCTING))

    def tell(self, progress: Progress) -> None:
        """Tell how far something else is, if there is anything to do."""
        if self._on_progress is not None and progress.total:
            self._on_progress(progress)

    def step(self) -> None:
        """The present one is over."""
        self._over += self._total


def _drive(
    run: Run,
    chains: Mapping[str, Calls],
    before: int,
    after: int,
    checkpoints: Checkpoints,
    on_progress: Callable[[Progress], None],
) -> None:
    """Run chains, each with its name among the checkpoints, to their end."""
    first = [(name, call) for name, chain in chains.items() for call in chain.first()]

    def report() -> None:
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

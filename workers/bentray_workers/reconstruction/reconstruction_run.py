"""Reconstruction of a dataset file, on a cluster or in this process, by the same task graphs."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import NamedTuple

from distributed import Client

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.quality.water_speed import WATER_SPEED, replaced_water, water_summary
from bentray_kernels.acquisition.water import describe_assumption
from bentray_kernels.task_graph import Pool, run, run_resumable
from bentray_kernels.tomography import Candidate, Progress, Reconstruction, Settings
from bentray_kernels.tomography.cautions import with_settings_caution
from bentray_kernels.tomography.guided_picking import same_picks
from bentray_kernels.tomography.reconstruction import run_reconstruction
from bentray_kernels.tomography.reconstruction_graph import ReconstructionGraph, TomographyGraph, progress_of
from bentray_kernels.tomography.reflection.reflection_plan import Echoes

from ..cluster.capacities import resources_for
from ..cluster.checkpoints import Checkpoints
from ..cluster.fair_shares import Share
from ..cluster.resources import RECONSTRUCTION
from ..cluster.task_pool import open_pool
from ..files.dataset import read_dataset
from ..files.dataset.scan import read_scan, spectrum_of
from ..files.dataset.traces import lacks_water, trace_samples
from ..files.findings import ScanFindings, read_findings
from ..files.reconstruction import write_reconstruction
from ..files.reference import read_reference, reference_path
from ..files.volume_export import FREQUENCY
from .blocks.block_choice import settled_blocks
from .blocks.block_files import BLOCKS
from .blocks.block_graph import BlockSartGraph
from .device_of_job import settled
from .file_scan import FileEchoScan, FileScan, FileWaveScan
from .picking_graph import PickingFiles, PickingGraph, PickingGuide, PickingSource

# Phase of the progress of a job, after those of ``picking_graph``.
RECONSTRUCTING = "reconstructing"

# Folder of the checkpoints in the work folder.
CHECKPOINTS = "checkpoints"


def reconstruct(
    client: Client | None,
    dataset_path: Path,
    settings: Settings,
    on_progress: Callable[[Progress], None] | None = None,
    stop: Callable[[], bool] | None = None,
    work_dir: Path | None = None,
    on_saved: Callable[[], None] | None = None,
    share: Share | None = None,
    threads: int | None = 1,
) -> Reconstruction:
    """Reconstruct a dataset file.

    Tasks get the path of the file, never its arrays: a lost worker then costs one batch of emitters. The
    state of each slice comes back after every batch, so that the loop can report, stop and save it.

    Args:
        client: of a cluster; None: threads of this process. The bits do not depend on it.
        dataset_path: a file in the upload format, readable by every worker.
        settings: see ``Settings``.
        on_progress: called after each batch.
        stop: polled several times a second; true raises ``Cancelled``.
        work_dir: a folder for picked travel times and checkpoints, which every worker can read and write; an
            unfinished run of the same dataset and settings is resumed from it, to the same bits. None: a
            temporary folder of this machine.
        on_saved: called after each checkpoint.
        share: of the workers; None: all of them.
        threads: without a client; None: one for each core.

    Raises:
        Cancelled: when ``stop`` returned true.
        InvalidInput: from the file or the settings, and for a device that no worker offers.
    """
    requested = settings
    with _folder(work_dir) as folder:
        settings = settled(client, folder, dataset_path, settings)
        settings = settled_blocks(client, folder, dataset_path, settings)
        resources = RECONSTRUCTION if client is None else resources_for(client, settings)
        pool = open_pool(client, folder, share, placement=lambda: {"resources": resources}, threads=threads)
        checkpoints = Checkpoints(folder / CHECKPOINTS, on_saved or (lambda: None))
        job = _Job(pool, stop, dataset_path, folder, checkpoints, count())
        progress = _JobProgress(on_progress)
        path, findings, chosen, trials = _pick_with_guides(job, settings, progress)
        result = _reconstruct_picked(job, path, chosen, progress)
        result = replace(result, trials=trials or result.trials)
        estimated = _estimated(
            job, findings, settings.water_temperature_c, attenuation=result.attenuation is not None
        )
    if settings.picking.examine or findings.findings:
        estimated["quality"] = findings.words(stacked=result.speed.ndim == 3)
    result = replace(result, provenance={**result.provenance, **estimated})
    header = read_dataset(dataset_path, traces=False, plausible=False)
    picks = header.tof_s is None and header.delta_tof_s is None
    return with_settings_caution(result, requested, picks=picks)


def _estimated(
    job: _Job, findings: ScanFindings, water_temperature_c: float | None, *, attenuation: bool
) -> dict[str, str]:
    """Entries of the provenance about the scan: frequency, what was estimated of the pulse, and the water."""
    scan = read_dataset(job.scan, traces=False, plausible=False)
    estimated = {}
    frequency = scan.amplitude_frequency_hz or scan.center_frequency_hz
    spectrum = spectrum_of(job.scan, scan)
    if spectrum is not None:
        estimated["pulse"] = spectrum.summary
        frequency = frequency or spectrum.center_frequency_hz
    if attenuation and frequency is not None:
        # For exports in dB/cm/MHz.
        estimated[FREQUENCY] = repr(float(frequency))
    used = scan.in_water_of(water_temperature_c)
    replaced = "" if used is scan else replaced_water(scan, used)
    if water := " ".join(note for note in (replaced, _water(job, findings, used)) if note):
        estimated["water"] = water
    return estimated


def _water(job: _Job, findings: ScanFindings, scan: Dataset) -> str:
    """Estimated or assumed properties of the water of a scan; empty for water that is stated."""
    shot = reference_path(job.folder, 0)
    if shot.exists():
        reference = read_reference(shot)
        return water_summary(scan, reference.speed_mps, reference.speed_sigma_mps)
    of_water = next((finding for finding in findings.findings if finding.check == WATER_SPEED), None)
    if of_water is not None:
        return f"{of_water.found}, {of_water.action}"
    if scan.water_temperature_assumed and scan.water_temperature_c is not None:
        return describe_assumption(scan.water_temperature_c)
    return ""


class _Job(NamedTuple):
    """State of a reconstruction; ``runs`` numbers the groups of graphs that are run."""

    pool: Pool
    stop: Callable[[], bool] | None
    scan: Path
    folder: Path
    checkpoints: Checkpoints
    runs: Iterator[int]


def _pick_with_guides(
    job: _Job, settings: Settings, progress: _JobProgress
) -> tuple[Path, ScanFindings, Settings, tuple[Candidate, ...]]:
    """A file with travel times, and the findings in the scan: picked, and again guided by images.

    Also the settings to continue with: what ``auto`` chose for the first image holds for all, so that the
    settings of the result reproduce it.
    """
    amplitudes = settings.attenuation.amplitudes if settings.reads_amplitudes else "recorded"
    source = PickingSource(
        job.scan,
        job.scan.stat().st_mtime_ns,
        job.folder,
        settings.picking.picker,
        settings.picking.examine,
        amplitudes,
        settings.method == "waveform",
        settings.water_temperature_c,
        settings.picking.max_left_out,
    )
    path, findings = _pick(job, source, PickingFiles.in_folder(job.folder), None, progress)
    rounds = 0 if source.dataset.picked else settings.numerics.guided_rounds
    rays = settings.changed(
        method="auto" if settings.method == "waveform" else settings.method,
        attenuation=False,
        resolution_check=False,
        uncertainty=False,
        reflection=False,
        minutes=None,
    )
    trials: tuple[Candidate, ...] = ()
    for number in range(1, rounds + 1):
        progress.following = 1 + rounds - number
        image = job.folder / f"{number}-image.h5"
        result = _reconstruct_picked(job, path, rays, progress)
        write_reconstruction(image, result)
        progress.next()
        if settings.method == "auto" and not trials:
            rays, trials = result.settings, result.trials
            names = ("attenuation", "resolution_check", "uncertainty", "reflection", "minutes")
            requested = {name: getattr(settings, name) for name in names}
            settings = rays.changed(**requested)
        guide = PickingGuide(image, PickingFiles.in_folder(job.folder).findings)
        again, findings_again = _pick(
            job, source, PickingFiles.in_folder(job.folder, number), guide, progress
        )
        if same_picks(*(read_dataset(scan, traces=False) for scan in (path, again))):
            break
        path, findings = again, findings_again
    progress.following = 0
    return path, findings, settings, trials


def _pick(
    job: _Job, source: PickingSource, files: PickingFiles, guide: PickingGuide | None, progress: _JobProgress
) -> tuple[Path, ScanFindings]:
    """The file to reconstruct after a round of picking, and its findings."""
    try:
        findings = read_findings(files.findings, files.picked)
        if source.estimates_water:
            for index in range(source.dataset.slices):
                read_reference(reference_path(job.folder, index))
    except (OSError, ValueError, KeyError, TypeError):
        # Absent, or damaged since.
        graph = PickingGraph(source, files, guide)
        progress.show(graph.progress)
        run({"picking": graph}, job.pool, lambda _name: progress.show(graph.progress), job.stop)
        findings = read_findings(files.findings)
    return files.picked if findings.changed else job.scan, findings


def _reconstruct_picked(job: _Job, path: Path, settings: Settings, progress: _JobProgress) -> Reconstruction:
    # A scan with travel times and without a water shot has no estimated one, unless waves are requested.
    lacking = lacks_water(job.scan)
    bare = lacking and not reference_path(job.folder, 0).exists()
    stamp, recorded = path.stat().st_mtime_ns, job.scan.stat().st_mtime_ns
    faults = PickingFiles.in_folder(job.folder).findings

    def run_graphs(graphs: Sequence[TomographyGraph], before: int, after: int) -> None:
        # A resumed job runs the same groups in the same order, so a number names the same graph again.
        number = next(job.runs)
        named = {f"{number}-{k:05d}": graph for k, graph in enumerate(graphs)}

        def report() -> None:
            progress.show_reconstruction(progress_of(graphs, before, after))

        run_resumable(named, job.pool, job.checkpoints, report, job.stop)
        if not after:
            report()

    return run_reconstruction(
        read_scan(path).in_water_of(settings.water_temperature_c),
        settings,
        lambda plan, part: FileScan(path, stamp, plan, part),
        run_graphs,
        lambda plan, index: FileWaveScan(
            job.scan,
            recorded,
            replace(plan, estimates_source=lacking),
            index,
            faults,
            settings.water_temperature_c,
        ),
        0 if bare else trace_samples(job.scan),
        _echoes(job, recorded, settings.water_temperature_c),
        partial(BlockSartGraph, folder=job.folder / BLOCKS)
        if settings.numerics.blocks > 1
        else ReconstructionGraph,
    )


def _echoes(job: _Job, stamp: int, water_temperature_c: float | None) -> Echoes | None:
    """The traces of the object; None without any."""
    samples, faults = trace_samples(job.scan), PickingFiles.in_folder(job.folder).findings
    if not samples:
        return None
    return Echoes(samples, lambda index: FileEchoScan(job.scan, stamp, index, faults, water_temperature_c))


class _JobProgress:
    """Progress of several reconstructions in a row as of one.

    Attributes:
        following: how many may follow the present one.
    """

    def __init__(self, on_progress: Callable[[Progress], None] | None) -> None:
        self._on_progress = on_progress
        self._over = self._total = self.following = 0

    def show_reconstruction(self, progress: Progress) -> None:
        """Report the progress of the present reconstruction."""
        self._total = progress.total
        total = self._over + progress.total * (1 + self.following)
        done = self._over + progress.done
        self.show(replace(progress, done=done, total=total, phase=RECONSTRUCTING))

    def show(self, progress: Progress) -> None:
        """Report progress of a phase, if it has any work."""
        if self._on_progress is not None and progress.total:
            self._on_progress(progress)

    def next(self) -> None:
        """The present reconstruction is over."""
        self._over += self._total


def _folder(work_dir: Path | None) -> AbstractContextManager[Path]:
    return _temporary_folder() if work_dir is None else nullcontext(work_dir)


@contextmanager
def _temporary_folder() -> Iterator[Path]:
    """A folder that is removed at the end, also while tasks of a cancelled job still run."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as outer:
        folder = Path(outer) / "work"
        folder.mkdir()
        try:
            yield folder
        finally:
            # Such a task then finds no folder under the old name to write into.
            folder.rename(folder.with_name("ended"))

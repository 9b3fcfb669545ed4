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
from bentray_kernels.tomography import Progress, Reconstruction, Settings
from bentray_kernels.tomography.cautions import with_settings_caution
from bentray_kernels.tomography.reconstruction import run_reconstruction
from bentray_kernels.tomography.reconstruction_graph import ReconstructionGraph, TomographyGraph, progress_of
from bentray_kernels.tomography.settled import settled

from ..cluster.checkpoints import Checkpoints
from ..cluster.fair_shares import Share
from ..cluster.job_progress import job_progress
from ..cluster.task_pool import open_pool
from ..files.dataset.read import check_readable
from ..files.dataset.scan import ScanHeader
from ..files.picking_files import ScanFindings, read_findings, read_reference, reference_path
from ..files.volume_export import FREQUENCY
from .blocks.block_files import BLOCKS
from .blocks.block_graph import BlockSartGraph
from .file_scan import FileSource, read_once
from .job_machine import JobMachine
from .picking_graph import PickingFiles, PickingGraph, PickingSource

# Phase of the progress of a job, after those of ``picking_graph``.
RECONSTRUCTING = "reconstructing"

_Show = Callable[[Progress], None]

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
        on_progress: called after each batch, and while workers compile.
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
    stamp = dataset_path.stat().st_mtime_ns
    header = read_once(dataset_path, stamp)
    with _folder(work_dir) as folder:
        machine = JobMachine(client, folder)
        machine.place(settings)
        pool = open_pool(client, folder, share, placement=lambda: machine.placement, threads=threads)
        checkpoints = Checkpoints(folder / CHECKPOINTS, on_saved or (lambda: None))
        progress = job_progress(client, on_progress)
        job = _Job(pool, progress.watching(stop), dataset_path, stamp, folder, checkpoints, count(), machine)

        def show(now: Progress) -> None:
            if now.total:
                progress.report(now)

        path, findings = _pick(job, settings, show)
        result = _reconstruct_picked(job, path, settings, show)
        estimated = _estimated(
            job, header, findings, settings.water_temperature_c, attenuation=result.attenuation is not None
        )
    if settings.picking.examine or findings.findings:
        estimated["quality"] = findings.words(stacked=result.speed.ndim == 3)
    estimated["pairs"] = findings.pairs_used
    result = replace(result, provenance={**result.provenance, **estimated})
    return with_settings_caution(result, settings, picks=not header.dataset.picked)


def _estimated(
    job: _Job,
    header: ScanHeader,
    findings: ScanFindings,
    water_temperature_c: float | None,
    *,
    attenuation: bool,
) -> dict[str, str]:
    """Entries of the provenance about the scan: frequency, what was estimated of the pulse, and the water."""
    scan, estimated = header.dataset, {}
    frequency = scan.amplitude_frequency_hz or scan.center_frequency_hz
    if header.spectrum is not None:
        estimated["pulse"] = header.spectrum.summary
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
    stop: Callable[[], bool]
    scan: Path
    stamp: int
    folder: Path
    checkpoints: Checkpoints
    runs: Iterator[int]
    machine: JobMachine


def _pick(job: _Job, settings: Settings, show: _Show) -> tuple[Path, ScanFindings]:
    """A file with travel times, and the findings in the scan."""
    source = PickingSource(job.scan, job.stamp, job.folder, settings)
    files = PickingFiles.in_folder(job.folder)
    try:
        findings = read_findings(files.findings, files.picked)
        if source.estimates_water:
            for index in range(source.dataset.slices):
                read_reference(reference_path(job.folder, index))
    except (OSError, ValueError, KeyError, TypeError):
        # Absent, or damaged since.
        graph = PickingGraph(source, files)
        show(graph.progress)
        run({"picking": graph}, job.pool, lambda _name: show(graph.progress), job.stop)
        findings = read_findings(files.findings)
    return files.picked if findings.changed else job.scan, findings


def _reconstruct_picked(job: _Job, path: Path, settings: Settings, show: _Show) -> Reconstruction:
    stamp = job.stamp if path == job.scan else path.stat().st_mtime_ns
    check_readable(read_once(path, stamp).dataset)
    faults = PickingFiles.in_folder(job.folder).findings
    source = FileSource(path, stamp, job.scan, job.stamp, faults, settings.water_temperature_c)
    chosen = settled(source, settings, job.machine)
    job.machine.place(chosen.settings)

    def run_graphs(graphs: Sequence[TomographyGraph], before: int, after: int) -> None:
        # A resumed job runs the same groups in the same order, so a number names the same graph again.
        number = next(job.runs)
        named = {f"{number}-{k:05d}": graph for k, graph in enumerate(graphs)}

        def report() -> None:
            show(replace(progress_of(graphs, before, after), phase=RECONSTRUCTING))

        run_resumable(named, job.pool, job.checkpoints, report, job.stop)
        if not after:
            report()

    in_blocks = partial(BlockSartGraph, folder=job.folder / BLOCKS)
    graph_of = in_blocks if chosen.settings.numerics.blocks > 1 else ReconstructionGraph
    return run_reconstruction(source, chosen, run_graphs, graph_of)


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

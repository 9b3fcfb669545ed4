"""`bentray reconstruct`: reconstruct a dataset file without a server."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .options.paths import output_folder
from .options.scan_options import checked_dataset, dataset_file, input_scan, metadata_of, with_scan_options
from .options.settings_options import settings_from, with_settings_options
from .output.exit_codes import AcceptDoubtful, end_doubtful
from .output.results import show_results, write_results
from .output.terminal import AsJson, progress_bar, progress_shown

if TYPE_CHECKING:
    from bentray_kernels.acquisition import Dataset
    from bentray_kernels.tomography import Progress, Reconstruction, Settings


@with_scan_options
@with_settings_options
def reconstruct(
    file: Annotated[Path, typer.Argument(help="Dataset file, or a scan of another program.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Output folder; an earlier result in it is replaced.")
    ],
    options: dict[str, Any],
    scan_options: dict[str, Any],
    workers: Annotated[
        int | None,
        typer.Option(
            min=1,
            show_default="number of parallel tasks, at most one per core",
            help="Worker processes; 1 runs in this process.",
        ),
    ] = None,
    accept_doubtful: AcceptDoubtful = False,
    as_json: AsJson = False,
) -> None:
    """Reconstruct a scan into OUTPUT/reconstruction.h5, .png and .json.

    The exit code is 3 for a doubtful result: its first line says why.

    Example:  bentray reconstruct scan.h5 -o result --rays curved --iterations 6
    """
    source, folder = input_scan(file), output_folder(output)
    settings, given = settings_from(options), metadata_of(scan_options)

    started = time.perf_counter()
    with progress_bar("Reconstructing") as step, dataset_file(source, given, folder) as scan:
        # Loading kernels takes seconds.
        dataset = checked_dataset(scan, settings)
        result = run(scan, dataset, settings, workers, progress_shown(step))
    took = time.perf_counter() - started
    with progress_bar("Drawing"):
        found = write_results(folder, result, dataset, took, file=str(source))
    show_results(f"Reconstruction of {source.name}", found, as_json=as_json)
    end_doubtful(bool(found["doubt"]), 1, accepted=accept_doubtful)


def run(
    file: Path, dataset: Dataset, settings: Settings, workers: int | None, show: Callable[[Progress], None]
) -> Reconstruction:
    """Reconstruct a file with worker processes of this command; None: with as many as are useful."""
    from bentray_workers.reconstruction.reconstruction_run import reconstruct as reconstruct_slices

    count = workers or useful_workers(dataset, settings)
    if count == 1:
        return reconstruct_slices(None, file, settings, show)
    from bentray_workers.cluster.connection import open_cluster

    with open_cluster(workers=count) as cluster:
        return reconstruct_slices(cluster.client, file, settings, show)


def useful_workers(dataset: Dataset, settings: Settings) -> int:
    """The useful number of worker processes, at most one per core.

    Parallel are slices, the emitters of a volume with Gauss-Newton, and candidate models of ``auto``. SART
    processes emitters one after another, and Gauss-Newton of one slice is faster than the start of workers.

    Raises:
        InvalidInput: for a volume of a scan with one height only.
    """
    from bentray_kernels.tomography.decomposition import decomposition_of
    from bentray_kernels.tomography.pairs import count

    problems, cores = count(dataset, settings), len(os.sched_getaffinity(0))
    of_array = decomposition_of(dataset.element_position_m, settings)
    volume = of_array == "volume" and settings.method == "gauss-newton"
    return cores if volume or settings.selects_model else min(problems, cores)

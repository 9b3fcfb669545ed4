"""`bentray reconstruct` and `bentray reproduce`: reconstruct a dataset file without a server, and again."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .options.option_tables import settings_from, with_settings_options
from .options.paths import input_file, output_folder
from .options.scan_options import checked_dataset, dataset_file, input_scan, metadata_of, with_scan_options
from .output.exit_codes import AcceptDoubtful, WorkFailed, end_doubtful
from .output.results import show_results, write_results
from .output.terminal import AsJson, print_json, print_lines, print_table, progress_bar, progress_shown

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


def reproduce(
    result: Annotated[Path, typer.Argument(help="A reconstruction.h5, made here or on another machine.")],
    scan: Annotated[Path, typer.Argument(help="The dataset file it was made from.")],
    workers: Annotated[
        int | None,
        typer.Option(
            min=1,
            show_default="number of parallel tasks, at most one per core",
            help="Worker processes; 1 runs in this process. The result does not depend on it.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Repeat a reconstruction with its own settings, and compare every array.

    The exit code is 0 if all arrays are identical, else 1. Other versions of Python, NumPy or Numba, or
    another processor, may round differently.

    Example:  bentray reproduce result/reconstruction.h5 scan.h5
    """
    from bentray_kernels.tomography.reconstruction import provenance
    from bentray_workers.files.dataset import read_dataset
    from bentray_workers.files.reconstruction import read_reconstruction

    record, source = input_file(result), input_file(scan)
    before, dataset = read_reconstruction(record), read_dataset(source, traces=False)
    with progress_bar("Reproducing") as step:
        after = run(source, dataset, before.settings, workers, progress_shown(step))
    differences = compared(before, after)
    here = provenance()
    other = {
        name: {"then": then, "now": here[name]}
        for name, then in before.provenance.items()
        if name in here and then != here[name]
    }
    if as_json:
        print_json(
            {"result": str(record), "scan": str(source), "differences": differences, "versions": other}
        )
    else:
        print_table(
            f"{record.name}, made again",
            ("array", "difference"),
            [(k, difference_text(v)) for k, v in differences.items()],
        )
        print_lines(f"{name}: {was['then']} then, {was['now']} now" for name, was in other.items())
    if any(differences.values()):
        raise WorkFailed(f"{record.name} was not reproduced" + _reason(differences, bool(other)))


def compared(before: Reconstruction, after: Reconstruction) -> dict[str, Any]:
    """The difference of each array: None if identical, the maximum difference, or a description."""
    import numpy as np

    from bentray_workers.files.quantities import IMAGES, REFLECTION

    differences: dict[str, Any] = {}
    held: list[dict[str, Any]] = [
        {place: getattr(result, name) for name, place in {**IMAGES, "residuals": "residuals"}.items()}
        | {REFLECTION: result.reflection and result.reflection.db}
        for result in (before, after)
    ]
    for place, old in held[0].items():
        new = held[1][place]
        if old is None and new is None:
            continue
        if old is None or new is None:
            differences[place] = "only then" if new is None else "only now"
        elif old.shape != new.shape:
            differences[place] = f"shape {old.shape} then, {new.shape} now"
        elif np.array_equal(old, new, equal_nan=True):
            differences[place] = None
        else:
            differences[place] = float(np.nanmax(np.abs(old - new), initial=0.0)) or "NaN at other nodes"
    old_rms, new_rms = ([sweep.residual_rms_s for sweep in one.history] for one in (before, after))
    differences["history"] = None if old_rms == new_rms else "different residuals"
    return differences


def difference_text(difference: float | str | None) -> str:
    """Description of a difference."""
    if difference is None:
        return "identical"
    return difference if isinstance(difference, str) else f"at most {difference:.3g}"


def _reason(found: dict[str, Any], other_versions: bool) -> str:
    if other_versions:
        return ": it was created with other versions"
    if found["speed_mps"] and found["history"]:
        return ": the scan may be another one"
    return ""

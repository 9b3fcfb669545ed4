"""`bentray reconstruct`: from a dataset file to images and figures, without a server."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .paths import input_file, output_folder
from .results import show_results, write_results
from .settings_options import (
    Eikonal,
    Method,
    Nodes,
    PenaltyStrength,
    Picker,
    Rays,
    Relaxation,
    Seed,
    Side,
    Smoothing,
    SpeedRange,
    SpeedUpdate,
    Sweeps,
    settings_from,
)
from .terminal import AsJson, progress_bar, residual_note

if TYPE_CHECKING:
    from bentray_kernels.acquisition import Dataset
    from bentray_kernels.tomography import Progress, Reconstruction, Settings


def reconstruct(
    file: Annotated[Path, typer.Argument(help="Dataset file (HDF5, format uct-transmission).")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the results; made if absent.")],
    method: Method = None,
    rays: Rays = None,
    eikonal: Eikonal = None,
    sweeps: Sweeps = None,
    relaxation: Relaxation = None,
    nodes: Nodes = None,
    side: Side = None,
    speed_update: SpeedUpdate = None,
    speed_range: SpeedRange = None,
    smoothing: Smoothing = None,
    penalty_strength: PenaltyStrength = None,
    picker: Picker = None,
    seed: Seed = None,
    workers: Annotated[
        int | None,
        typer.Option(
            min=1, show_default="one a slice, at most one a core", help="Worker processes; 1 uses none."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Reconstruct a scan into OUTPUT/reconstruction.h5, .png and .json.

    Example:  bentray reconstruct scan.h5 -o result --rays curved --sweeps 6
    """
    source, folder = input_file(file), output_folder(output)
    settings = settings_from(
        method=method,
        rays=rays,
        eikonal=eikonal,
        sweeps=sweeps,
        relaxation=relaxation,
        nodes=nodes,
        side_m=side,
        speed_update=speed_update,
        speed_range_mps=speed_range,
        smoothing_nodes=smoothing,
        penalty_strength=penalty_strength,
        picker=picker,
        seed=seed,
    )

    from bentray_workers.dataset_file import read_dataset

    dataset = read_dataset(source, traces=False)
    started = time.perf_counter()
    with progress_bar("Reconstructing") as step:

        def show(progress: Progress) -> None:
            rms = progress.history[-1].residual_rms_s if progress.history else None
            step(progress.done, progress.total, residual_note(rms))

        result = _run(source, dataset, settings, workers, show)
    found = write_results(folder, result, dataset, time.perf_counter() - started, file=str(source))
    show_results(f"Reconstruction of {source.name}", found, as_json=as_json)


def _run(
    file: Path, dataset: Dataset, settings: Settings, workers: int | None, show: Callable[[Progress], None]
) -> Reconstruction:
    from bentray_workers.slices import reconstruct as reconstruct_slices

    count = workers or min(dataset.slices, os.cpu_count() or 1)
    if count == 1:
        return reconstruct_slices(None, file, settings, show)
    from bentray_workers.cluster import open_cluster

    with open_cluster(workers=count) as cluster:
        return reconstruct_slices(cluster.client, file, settings, show)

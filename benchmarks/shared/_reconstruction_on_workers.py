"""Reconstruction by worker processes from a file, as in the service, with its error and time."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from bentray_kernels.acquisition import Dataset
from bentray_kernels.tomography import Reconstruction, Settings
from bentray_service.cli.output.terminal import Step
from bentray_workers.cluster.connection import open_cluster
from bentray_workers.files.dataset import write_dataset
from bentray_workers.images.truth_comparison import compare
from bentray_workers.reconstruction import reconstruction_run

# Two cores, as in the target.
WORKERS = 2


@dataclass(frozen=True)
class Made:
    """An image with its error and time.

    Attributes:
        result: the image.
        rms: its error, m/s.
        seconds: wall-clock time, s; includes picking only for FWI.
    """

    result: Reconstruction
    rms: float
    seconds: float


def reconstruct_on_workers(dataset: Dataset, settings: Settings, progress: Step) -> Made:
    """Reconstruct as the service does: from a file, by worker processes."""
    assert dataset.truth is not None
    with TemporaryDirectory() as folder, open_cluster(workers=WORKERS) as cluster:
        path = Path(folder) / "scan.h5"
        write_dataset(path, dataset)
        begun = time.perf_counter()
        result = reconstruction_run.reconstruct(
            cluster.client, path, settings, lambda now: progress(now.done, now.total, settings.method)
        )
        seconds = time.perf_counter() - begun
    return Made(result, compare(result, dataset.truth, dataset.roi).rmse_mps, seconds)

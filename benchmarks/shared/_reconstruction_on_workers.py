"""Reconstruction by worker processes from a file, as in the service, with its error and time."""

import time
from dataclasses import dataclass

from bentray_kernels.acquisition import Dataset
from bentray_kernels.tomography import Reconstruction, Settings
from bentray_kernels.tomography.comparison import compare
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_workers.files.dataset import write_dataset
from bentray_workers.reconstruction import reconstruction_run


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


def reconstruct_on_workers(dataset: Dataset, settings: Settings, context: BenchmarkContext) -> Made:
    """Reconstruct as the service does: from a file, by worker processes."""
    assert dataset.truth is not None
    with context.temporary_folder() as folder, context.cluster() as cluster:
        path = folder / "scan.h5"
        write_dataset(path, dataset)
        begun = time.perf_counter()
        result = reconstruction_run.reconstruct(
            cluster.client, path, settings, lambda now: context.progress(now.done, now.total, settings.method)
        )
        seconds = time.perf_counter() - begun
    return Made(result, compare(result, dataset.truth, dataset.roi).rms, seconds)

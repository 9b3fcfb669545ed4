"""Reconstruction by worker processes from a file, as in the service, with its error and time."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from bentray_kernels.acquisition import Dataset
from bentray_kernels.tomography import Progress, Reconstruction, Settings
from bentray_kernels.tomography.comparison import compare
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_workers.cluster.connection import Cluster
from bentray_workers.files.dataset import write_dataset
from bentray_workers.reconstruction import reconstruction_run

from ._baselines import Image, Images


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


def reconstruct_file(
    dataset: Dataset,
    settings: Settings,
    context: BenchmarkContext,
    cluster: Cluster | None,
    what: str = "",
    *,
    threads: int | None = 1,
    saved: bool = False,
) -> Image:
    """Reconstruct a scan from a file; the time is without that of writing the file.

    Args:
        dataset: the scan.
        settings: of its reconstruction.
        context: with the progress.
        cluster: of workers; None: this process.
        what: said meanwhile; empty: the method.
        threads: of this process; None: as many as processors.
        saved: whether its state is saved meanwhile, as by the service.
    """
    with context.temporary_folder() as folder:
        path, client = folder / "scan.h5", cluster and cluster.client
        write_dataset(path, dataset)

        def progress(now: Progress) -> None:
            context.progress(now.done, now.total, what or settings.method)

        begun = time.perf_counter()
        result = reconstruction_run.reconstruct(
            client, path, settings, progress, threads=threads, work_dir=folder if saved else None
        )
        return Image(result, time.perf_counter() - begun)


def reconstruct_on_workers(dataset: Dataset, settings: Settings, context: BenchmarkContext) -> Made:
    """Reconstruct as the service does: from a file, by worker processes."""
    assert dataset.truth is not None
    with context.cluster() as cluster:
        result, seconds = reconstruct_file(dataset, settings, context, cluster)
    return Made(result, compare(result, dataset.truth, dataset.roi).rms, seconds)


def reconstruct_in_ways(
    dataset: Dataset, ways: Mapping[str, Mapping[str, Any]], context: BenchmarkContext
) -> dict[str, Made]:
    """Images of the speed by several settings, which are given by name."""
    return {
        way: reconstruct_on_workers(dataset, Settings.from_values(attenuation=False, **changes), context)
        for way, changes in ways.items()
    }


def images_on_workers(dataset: Dataset, context: BenchmarkContext) -> Images:
    """Baselines of images of the speed, as they are needed."""
    return Images(
        dataset,
        lambda scan, settings: reconstruct_on_workers(scan, settings, context).result,
        Settings.from_values(attenuation=False),
    )

"""Sizing benchmark: memory, CPU time and disk space of reconstructions in a worker, beside their plans."""

import os
from collections.abc import Iterable
from pathlib import Path
from time import process_time
from typing import NamedTuple

from bentray_kernels.tomography import Settings
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_workers.cluster.capacities import MIB, WARM_BYTES
from bentray_workers.cluster.connection import open_cluster
from bentray_workers.files.dataset.scan import counts_in
from bentray_workers.files.reconstruction import write_reconstruction
from bentray_workers.reconstruction.planning import plan
from bentray_workers.reconstruction.reconstruction_run import reconstruct

from ..shared._synthetic_scan import made_up_scan
from ._worker_use import forget_peak, of_worker, peak_bytes


class Size(NamedTuple):
    """Elements of a ring, nodes along each side of the image, slices, and the method."""

    elements: int
    nodes: int
    slices: int
    method: str

    def __str__(self) -> str:
        slices = f"{self.slices} slice{'s' if self.slices > 1 else ''}"
        return f"{self.elements} elements, {self.nodes}², {slices}, {self.method}"


METHODS = ("sart", "gauss-newton", "auto")
QUICK = tuple(Size(*row, method) for row in ((64, 64, 1), (64, 64, 4)) for method in METHODS)
SIZES = (
    *(Size(*row, method) for row in ((64, 96, 1), (128, 128, 1), (256, 192, 1)) for method in METHODS),
    *(Size(*row, method) for row in ((256, 192, 8), (512, 256, 1), (512, 256, 4)) for method in METHODS[:2]),
)
# Loads the compiled code of all methods.
SMALL = Size(16, 32, 1, "auto")


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Memory and disk space of each size, each with its plan as goal."""
    sizes = QUICK if context.quick else SIZES
    for number, size in enumerate(sizes):
        context.progress(number, len(sizes), str(size))
        with context.temporary_folder() as folder:
            yield from measured(folder, size)


def measured(folder: Path, size: Size) -> Iterable[Row]:
    """Reconstruct in a worker process of its own, as the service does, and compare with the plan."""
    load, settings = os.getloadavg()[0], settings_of(size)
    path = made_up_scan(folder / "scan.h5", size.elements, size.slices)
    work, volume = folder / "work", folder / "volume.h5"
    work.mkdir()
    stored = 0

    def saved() -> None:
        nonlocal stored
        stored = max(stored, sum(path.stat().st_size for path in work.rglob("*") if path.is_file()))

    with open_cluster(workers=1, local_directory=folder) as cluster:
        small = made_up_scan(folder / "small.h5", SMALL.elements, SMALL.slices)
        reconstruct(cluster.client, small, settings_of(SMALL))
        of_worker(cluster.client, forget_peak)
        warm, before = (of_worker(cluster.client, figure) for figure in (peak_bytes, process_time))
        result = reconstruct(cluster.client, path, settings, work_dir=work, on_saved=saved)
        peak, after = (of_worker(cluster.client, figure) for figure in (peak_bytes, process_time))
    write_reconstruction(volume, result)
    planned = plan(counts_in(path).summary(settings), settings, ())
    files = {"scan": path.stat().st_size, "checkpoints": stored, "volume": volume.stat().st_size}
    figures = {
        "elements": size.elements,
        "nodes": size.nodes,
        "slices": size.slices,
        "warm worker, MiB": warm / MIB,
        "peak, MiB": peak / MIB,
        "CPU, s": after - before,
        "planned CPU, s": planned.work_s,
        **{f"{name}, MiB": length / MIB for name, length in files.items()},
    }
    yield Row(
        f"sizing {size}: memory above a warm worker",
        (peak - warm) / MIB,
        planned.largest[1] / MIB,
        "<=",
        "MiB",
        f"{after - before:.1f} s of CPU, planned {planned.work_s:.0f} s; warm worker {warm / MIB:.0f} MiB, "
        f"planned {WARM_BYTES / MIB:.0f} MiB; load average {load:.1f}",
        figures=figures,
    )
    yield Row(
        f"sizing {size}: disk",
        (files["checkpoints"] + files["volume"]) / MIB,
        planned.stored_bytes / MIB,
        "<=",
        "MiB",
        ", ".join(f"{name} {length / MIB:.2f} MiB" for name, length in files.items()),
    )


def settings_of(size: Size) -> Settings:
    """The default settings of a method on a grid."""
    return Settings.from_values(method=size.method, nodes=size.nodes)

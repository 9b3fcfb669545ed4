"""R9: the 3-D breast phantom (Table 7) scanned in 3-D, reconstructed slice by slice and in 3-D."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from bentray_kernels.tomography import Reconstruction, Settings
from bentray_kernels.tomography.problem import MARGIN_NODES
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_workers.simulation.simulation_run import simulate
from bentray_workers.simulation.volume import VolumeSimulationSettings

from ..shared._baselines import Compared, Images
from ..shared._image_error import object_error
from ..shared._reconstruction_on_workers import reconstruct_file
from ._sections_picture import picture_of_sections

COUPLING_MPS = 1375.0

# The dissertation's slices are 128² times 40. In space each of their wave fronts costs a hundred times what
# one in a plane does, so half of each side is measured here.
FULL, QUICK = (64, 20, 64), (24, 6, 24)

SNR = 10.0


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Errors inside the breast over the range of the phantom, without noise and with SNR 10."""
    nodes, slices, elements = QUICK if context.quick else FULL
    asked = VolumeSimulationSettings(
        nodes, slices, elements, COUPLING_MPS, refinement=2, three_d=True, array="moved"
    )
    size = f"{nodes}² by {slices}, {elements} elements, times in space on a grid twice as fine"
    with context.cluster() as cluster:
        clean = simulate(
            asked, lambda p: context.progress(p.done, p.total, "simulating in space"), cluster.client
        )
        delta = clean.delta_tof_s
        sigma = float(np.sqrt(np.nanmean(delta**2))) / SNR
        noise = np.random.default_rng(0).normal(0.0, sigma, delta.shape)
        noisy = replace(clean, delta_tof_s=delta + noise)
        results: dict[str, Reconstruction] = {}
        for label, dataset in (("exact", clean), (f"SNR {SNR:g}", noisy)):
            images = Images(
                dataset,
                lambda scan, settings, n=label: (
                    reconstruct_file(scan, settings, context, cluster, n, saved=True).result
                ),
            )
            compared: dict[str, Compared] = {}
            for way in ("slices", "volume"):
                settings = Settings(
                    method="gauss-newton", decomposition=way, nodes=nodes, side_m=asked.scan().side_m
                )
                image, seconds = images.made(settings)
                name = f"{label}, {way}"
                results[name] = inner(image, slices)
                error = compared[way] = images.compared(image, object_error(clean, relative=True))
                yield error.row(
                    f"R9 {name}", error.error, 0.04, "<=", "of range", f"NRMSE, {size}, {seconds:.0f} s"
                )
            worse = compared["slices"].error - compared["volume"].error
            target = f"R9 slice-wise over 3-D, {label}"
            yield compared["slices"].row(target, worse, 0.003, "<=", "of range", f"NRMSE, {size}")
        context.save_picture("reconstruction_volume.png", lambda: picture_of_sections(clean.truth, results))
        context.progress(1, 1, "done")


def inner(result: Reconstruction, slices: int) -> Reconstruction:
    """A volume without the heights beyond the outermost rings."""
    if result.speed.shape[2] == slices:
        return result
    return replace(
        result,
        speed=result.speed[..., MARGIN_NODES : MARGIN_NODES + slices],
        coverage=result.coverage[..., MARGIN_NODES : MARGIN_NODES + slices],
    )

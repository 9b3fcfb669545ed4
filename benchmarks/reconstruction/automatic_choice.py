"""N1: the error of the automatic choice over the better of straight and bent SART, also with noise."""

import os
from collections.abc import Iterable

from bentray_kernels.acquisition import Dataset
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.model_selection.selection import explain_candidates
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_workers.simulation.plane import SimulationSettings

from ..shared._baselines import Images
from ..shared._image_error import ErrorOn
from ._ladder import FAT_MPS, WATER_MPS
from ._phantom_scan import PhantomScan
from ._unseen_scans import unseen_scans

GOAL = 1.03
SNRS = (None, 30.0, 10.0)
SART = Settings.from_values(method="sart", attenuation=False)
DEFAULT = Settings.from_values(attenuation=False)


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Table 6 in two waters with three noises, then scans that chose no setting."""
    nodes, elements = (48, 32) if context.quick else (128, 256)
    for coupling in (FAT_MPS, WATER_MPS):
        for snr in SNRS[-1:] if context.quick else SNRS:
            asked = SimulationSettings(nodes=nodes, elements=elements, coupling_mps=coupling, snr=snr)
            scan = PhantomScan.of_table6(asked, context.progress)
            noise = "exact" if snr is None else f"SNR {snr:g}"
            name = f"Table 6, water {coupling:g} m/s, {noise}"
            yield choice_row(name, scan.dataset, scan.mean_absolute, "% of range", context)
    for name, dataset, error_on in unseen_scans(context):
        yield choice_row(name, dataset, error_on, "m/s", context)


def choice_row(name: str, dataset: Dataset, error_on: ErrorOn, unit: str, context: BenchmarkContext) -> Row:
    """The error by default settings over that of the better image by SART."""
    images = Images.here(dataset, context.progress, name, DEFAULT)
    default, seconds = images.default()
    sart = {rays: images.made(SART.changed(rays=rays)).result for rays in ("straight", "curved")}
    errors = {rays: error_on(image).of(image) for rays, image in sart.items()}
    compared = images.compared(default, error_on)
    detail = (
        f"{compared.error:.2f} {unit}, SART straight {errors['straight']:.2f}, bent {errors['curved']:.2f}; "
        f"{explain_candidates(default.trials)}; {default.speed.shape[0]}² nodes, {seconds:.0f} s at load "
        f"{os.getloadavg()[0]:.0f}"
    )
    target = f"N1 {name}: error of the automatic choice over the better SART"
    return compared.row(target, compared.error / min(errors.values()), GOAL, "<=", "", detail)

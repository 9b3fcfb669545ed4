"""Images of Table 6 by the published settings and by ours, each beside the best constant."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from bentray_kernels.tomography import mean_absolute_error
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step
from bentray_workers.simulation.plane import SimulationSettings

from ..reconstruction._phantom_scan import PhantomScan

FAT_MPS = 1375.0
SLICES = ("table6", "table6-vertical")


def image_rows(quick: bool, progress: Step) -> Iterable[Row]:
    """Speed by first-order fronts, B-spline rays and default; attenuation by SART and with a penalty."""
    nodes, elements = (64, 64) if quick else (128, 256)
    for name in SLICES:
        wanted = SimulationSettings(
            phantom=name, nodes=nodes, elements=elements, coupling_mps=FAT_MPS, attenuation=True
        )
        scan = PhantomScan.of_table6(wanted, progress)
        ours = scan.run(progress, "default fronts")
        constant, water = _baselines(scan)
        beside = f"{name} in {FAT_MPS:g} m/s; one constant {constant:.1f} %, water {water:.1f} %"
        ways = {"SART, first-order FMM": {"eikonal": "fmm-first-order"}, "SART, HAFMM": {"eikonal": "hafmm"}}
        ways["SART, B-spline rays"] = {"ray_gradient": "bspline"}
        ways["SART, straight rays"] = {"rays": "straight"}
        for words, changes in ways.items():
            found = scan.run(progress, words, attenuation=False, **changes)
            detail = f"{beside}; ours, SART with default fronts, {ours.mae_percent:.2f} %; {found.how}"
            yield Row(f"{name}, {words}", found.mae_percent, ours.mae_percent, ">=", "% of range", detail)
        found = scan.run(progress, "attenuation by SART", attenuation_solver="sart")
        losses = scan.scan.phantom.attenuation(nodes, scan.scan.side_m)
        inside = scan.scan.phantom.inside(nodes, scan.scan.side_m)
        one = float(losses[inside].std() / np.ptp(losses[inside]))
        detail = (
            f"rms, one constant {one:.3f}; ours, with a penalty, {ours.attenuation_rmse:.3f}; {found.how}"
        )
        label = f"{name}, attenuation by SART"
        yield Row(label, found.attenuation_rmse, ours.attenuation_rmse, ">=", "of range", detail)


def _baselines(scan: PhantomScan) -> tuple[float, float]:
    """Mean absolute errors of the best constant and of the coupling alone, % of the range."""
    truth, (low, high) = scan.truth, scan.speed_range
    inside = scan.scan.phantom.inside(scan.scan.nodes, scan.scan.side_m)
    best = np.full(truth.shape, np.median(truth[inside]))
    water = np.full(truth.shape, scan.scan.phantom.coupling_mps)
    constant, coupling = (
        100.0 * mean_absolute_error(one, truth, inside, high - low) for one in (best, water)
    )
    return constant, coupling

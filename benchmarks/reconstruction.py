"""Table 2 of the targets: reconstructions of phantoms whose truth is known."""

from __future__ import annotations

import time
from collections.abc import Iterable

from bentray_kernels.tomography import (
    Progress,
    Reconstruction,
    Settings,
    mean_absolute_error,
    reconstruct,
    rmse,
)
from bentray_service.cli.row import Row
from bentray_service.cli.terminal import Step
from bentray_workers.simulation import SimulationSettings, simulate

COUPLING_MPS = 1375.0


def rows(quick: bool, progress: Step) -> Iterable[Row]:
    """R1 and the beginning of R3: Table 6 at coupling 1375, errors inside the breast's outline.

    R1 takes the best method offered, R3 that of the dissertation.
    """
    nodes, elements = (64, 64) if quick else (128, 256)
    asked = SimulationSettings(nodes, elements, COUPLING_MPS)
    scan = asked.scan()
    dataset = simulate(None, asked, lambda p: progress(p.done, p.total, "simulating"))
    truth, inside = scan.phantom.speed(nodes, scan.side_m), scan.phantom.inside(nodes, scan.side_m)
    # The dissertation divides by the range of the phantom, the coupling left out.
    low, high = scan.phantom.speed_range()

    def run(rays: str, method: str = "sart", sweeps: int = 5) -> tuple[Reconstruction, str]:
        settings = Settings(method=method, rays=rays, nodes=nodes, side_m=scan.side_m, sweeps=sweeps)
        started = time.perf_counter()

        def show(p: Progress) -> None:
            progress(p.done, p.total, f"{rays} rays, {method}")

        result = reconstruct(dataset, settings, show)
        used = max(sweep.sweep for sweep in result.history)
        how = f"{method}, {nodes}² nodes, {elements} elements, {used} sweeps"
        return result, f"{how}, {time.perf_counter() - started:.1f} s"

    straight, straight_how = run("straight")
    curved, curved_how = run("curved")
    best, best_how = run("curved", "gauss-newton", 12)
    straight_mae = mean_absolute_error(straight.speed, truth, inside, high - low)
    curved_mae = mean_absolute_error(curved.speed, truth, inside, high - low)
    best_mae = mean_absolute_error(best.speed, truth, inside, high - low)
    best_rmse = rmse(best.speed, truth, inside) / (high - low)
    ratio = straight_mae / curved_mae
    yield Row("R1 mean absolute error", 100 * best_mae, 2.0, "<=", "% of range", f"curved, {best_how}")
    yield Row("R1 rms error", best_rmse, 0.04, "<=", "of range", f"curved, {best_how}")
    yield Row(
        "R1 straight / curved",
        straight_mae / best_mae,
        3.0,
        ">=",
        "",
        f"mean errors; straight: {straight_how}",
    )
    yield Row("R3 curved", 100 * curved_mae, 4.0, "<=", "% of range", f"mean absolute error, {curved_how}")
    yield Row("R3 straight > curved", ratio, 1.0, ">", "", f"straight {100 * straight_mae:.1f} % of range")

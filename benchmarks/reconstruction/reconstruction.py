"""Goals R1 to R10: reconstructions whose truth is known, their errors, times and peers."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step
from bentray_workers.simulation.plane import SimulationSettings

from . import reconstruction_peers, reconstruction_time, reconstruction_volume
from ._ladder import BEST, FAT_MPS, LADDER, THEIRS, WATER_MPS, ladder_step
from ._phantom_scan import PhantomScan, ReconstructionError


def rows(quick: bool, progress: Step) -> Iterable[Row]:
    """R1 to R3, R5, R6, R8 and R9; the last four are benchmarks of their own as well."""
    nodes, elements = (64, 64) if quick else (128, 256)
    yield from fat_coupling(nodes, elements, progress)
    yield from water_coupling(nodes, elements, progress)
    yield from reconstruction_time.rows(quick, progress)
    yield from reconstruction_peers.rows(quick, progress)
    if not quick:
        yield from reconstruction_volume.rows(quick, progress)


def fat_coupling(nodes: int, elements: int, progress: Step) -> Iterable[Row]:
    """R1, R3 and R8 in a medium as fast as fat; R1 takes the best method, the others that of chapter 6."""
    asked = SimulationSettings(nodes, elements, FAT_MPS, attenuation=True)
    scan = PhantomScan.of_table6(asked, progress)
    ladder = {name: ladder_step(scan, name, progress) for name in LADDER}
    best = scan.run(progress, "best", **BEST)
    yield Row("R1 mean absolute error", best.mae_percent, 2.0, "<=", "% of range", best.how)
    yield Row("R1 rms error", best.rmse_of_range, 0.04, "<=", "of range", best.how)
    ratio = ladder["straight"].mae_percent / best.mae_percent
    yield Row("R1 straight / curved", ratio, 3.0, ">=", "", f"mean errors; {ladder['straight'].how}")
    yield from ordering(ladder, "1375")
    sart = scan.run(progress, "default")
    yield Row("R3 default settings", sart.mae_percent, 4.0, "<=", "% of range", sart.how)
    for name, found in (("best", best), ("default", sart)):
        yield Row(f"R8 line integrals, {name}", found.attenuation_rmse, 0.05, "<=", "of range", found.how)


def water_coupling(nodes: int, elements: int, progress: Step) -> Iterable[Row]:
    """R2, and the ladder of R3 again, in water faster than the fat."""
    scan = PhantomScan.of_table6(SimulationSettings(nodes, elements, WATER_MPS), progress)
    ladder = {name: ladder_step(scan, name, progress) for name in LADDER}
    straight = ladder["straight"]
    yield Row(
        "R2 straight, off 25 %", abs(straight.mae_percent - 25.0), 2.0, "<=", "% of range", straight.how
    )
    sart = scan.run(progress, "curved")
    yield Row("R2 curved SART", sart.mae_percent, 11.0, "<=", "% of range", sart.how)
    best = scan.run(progress, "best", **BEST)
    yield Row("R2 best method", best.mae_percent, 6.0, "<=", "% of range", best.how)
    yield from ordering(ladder, "1500")


def ordering(ladder: dict[str, ReconstructionError], coupling: str) -> Iterable[Row]:
    """Each rung over the next: above 1 where the order is the dissertation's."""
    names = list(ladder)
    for worse, better in pairwise(names):
        detail = (
            f"{ladder[worse].mae_percent:.1f} % over {ladder[better].mae_percent:.1f} %; "
            f"theirs {THEIRS[worse]:g} % over {THEIRS[better]:g} %"
        )
        ratio = ladder[worse].mae_percent / ladder[better].mae_percent
        yield Row(f"R3 {worse} > {better}, coupling {coupling}", ratio, 1.0, ">", "", detail)

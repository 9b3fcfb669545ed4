"""Goals R1 to R3 and R8: the 2-D breast phantom (Li 2008, Table 6) by exact times and amplitudes."""

from collections.abc import Iterable
from itertools import pairwise

from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import STRAIGHT_RAYS, Row
from bentray_service.cli.output.terminal import Step
from bentray_workers.simulation.plane import SimulationSettings

from ._ladder import FAT_MPS, LADDER, THEIRS, TUNED, WATER_MPS, ladder_step
from ._phantom_scan import PhantomScan, ReconstructionError


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """R1 to R3 and R8; ``reconstruction_time``, ``_peers`` and ``_volume`` measure R5, R6 and R9."""
    nodes, elements = (64, 64) if context.quick else (128, 256)
    yield from fat_coupling(nodes, elements, context.progress)
    yield from water_coupling(nodes, elements, context.progress)


def fat_coupling(nodes: int, elements: int, progress: Step) -> Iterable[Row]:
    """R1, R3 and R8 in a medium as fast as fat: default settings, SART of chapter 6, and tuned settings."""
    asked = SimulationSettings(nodes=nodes, elements=elements, coupling_mps=FAT_MPS, attenuation=True)
    scan = PhantomScan.of_table6(asked, progress)
    ladder = {name: ladder_step(scan, name) for name in LADDER}
    images = {
        "default": scan.run_default(),
        "SART": scan.run("SART"),
        "tuned": scan.run("tuned", **TUNED),
    }
    for name, error in images.items():
        tuned = name == "tuned"
        mean, rms = scan.compared(error, scan.mean_absolute), scan.compared(error, scan.rms)
        yield mean.row(
            f"R1 mean absolute error, {name}", mean.error, 2.0, "<=", "% of range", error.how, tuned=tuned
        )
        yield rms.row(f"R1 rms error, {name}", rms.error, 0.04, "<=", "of range", error.how, tuned=tuned)
        ratio = mean.baselines[STRAIGHT_RAYS] / mean.error
        how = f"mean absolute errors, the same method; {error.how}"
        yield mean.row(f"R1 straight over bent rays, {name}", ratio, 3.0, ">=", "", how, tuned=tuned)
    yield from ordering(scan, ladder, "1375")
    for name, error in images.items():
        loss = scan.compared(error, scan.attenuation_rms)
        target = f"R8 line integrals, {name}"
        yield loss.row(target, loss.error, 0.05, "<=", "of range", error.how, tuned=name == "tuned")


def water_coupling(nodes: int, elements: int, progress: Step) -> Iterable[Row]:
    """R2, and the ladder of R3 again, in water faster than the fat."""
    scan = PhantomScan.of_table6(
        SimulationSettings(nodes=nodes, elements=elements, coupling_mps=WATER_MPS), progress
    )
    ladder = {name: ladder_step(scan, name) for name in LADDER}
    straight = scan.compared(ladder["straight"], scan.mean_absolute)
    target = "R2 straight rays, difference from 25 %"
    yield straight.row(target, abs(straight.error - 25.0), 2.0, "<=", "% of range", ladder["straight"].how)
    for name, error, goal in (
        ("curved SART", scan.run("SART"), 11.0),
        ("default", scan.run_default(), 6.0),
        ("best method, tuned", scan.run("tuned", **TUNED), 6.0),
    ):
        mean = scan.compared(error, scan.mean_absolute)
        tuned = name.endswith("tuned")
        yield mean.row(f"R2 {name}", mean.error, goal, "<=", "% of range", error.how, tuned=tuned)
    yield from ordering(scan, ladder, "1500")


def ordering(scan: PhantomScan, ladder: dict[str, ReconstructionError], coupling: str) -> Iterable[Row]:
    """Each rung over the next: above 1 where the order is the dissertation's."""
    for worse, better in pairwise(ladder):
        detail = (
            f"{ladder[worse].mae_percent:.1f} % over {ladder[better].mae_percent:.1f} %; "
            f"theirs {THEIRS[worse]:g} % over {THEIRS[better]:g} %"
        )
        ratio = ladder[worse].mae_percent / ladder[better].mae_percent
        mean = scan.compared(ladder[better], scan.mean_absolute)
        yield mean.row(f"R3 {worse} > {better}, coupling {coupling}", ratio, 1.0, ">", "", detail)

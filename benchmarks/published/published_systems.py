"""Systems of the dissertation beside ours: rays, wave fronts, images, lookups, backdrops."""

from collections.abc import Iterable

from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step
from bentray_workers.simulation.plane import SimulationSettings

from ..reconstruction._phantom_scan import PhantomScan
from ._published_pictures import backdrop_rows, lookup_rows
from ._published_rays import front_rows, ray_rows
from ._speed_updates import SEEDS
from ._speed_updates import rows as update_rows

FAT_MPS = 1375.0
SLICES = ("table6", "table6-vertical")
WAYS: dict[str, dict[str, object]] = {
    "first-order FMM": {"eikonal": "fmm-first-order"},
    "HAFMM": {"eikonal": "hafmm"},
    "B-spline rays": {"ray_gradient": "bspline"},
}


def image_rows(quick: bool, progress: Step) -> Iterable[Row]:
    """SART by published fronts and rays beside SART by ours; attenuation by SART beside the penalised one."""
    nodes, elements = (64, 64) if quick else (128, 256)
    for name in SLICES:
        wanted = SimulationSettings(
            phantom=name, nodes=nodes, elements=elements, coupling_mps=FAT_MPS, attenuation=True
        )
        scan = PhantomScan.of_table6(wanted, progress)
        ours = scan.run("our fronts and rays")
        for words, changes in WAYS.items():
            result = scan.run(words, attenuation=False, **changes)
            mean = scan.compared(result, scan.mean_absolute)
            label, goal = f"{name} in {FAT_MPS:g} m/s, SART, {words}", ours.mae_percent
            detail = f"ours, SART with deviation and differences, {goal:.2f} %; {result.how}"
            yield mean.row(label, mean.error, goal, ">=", "% of range", detail)
        result = scan.run("attenuation by SART", attenuation_solver="sart")
        loss = scan.compared(result, scan.attenuation_rms)
        goal = ours.attenuation_rmse
        detail = f"rms; ours, with a penalty, {goal:.3f}; {result.how}"
        yield loss.row(f"{name}, attenuation by SART", loss.error, goal, ">=", "of range", detail)


PARTS = (
    ("rays", lambda quick, progress: ray_rows(quick)),
    ("wave fronts", lambda quick, progress: front_rows(quick)),
    ("images", image_rows),
    ("speed updates", lambda quick, progress: update_rows(1 if quick else SEEDS)),
    ("lookups", lambda quick, progress: lookup_rows(quick)),
    ("backdrops", lambda quick, progress: backdrop_rows(quick)),
)


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """One table; each row names both figures, and its goal is that ours is no worse."""
    for number, (name, table) in enumerate(PARTS):
        context.progress(number, len(PARTS), name)
        yield from table(context.quick, context.progress)
    context.progress(len(PARTS), len(PARTS), "done")

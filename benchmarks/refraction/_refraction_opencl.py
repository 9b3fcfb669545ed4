"""Frame rates of the refracting ball with OpenCL and with the compiled caster in the same run."""

import os
import warnings
from collections.abc import Callable, Iterable

import numpy as np

from bentray_kernels.opencl import OpenCLFallbackWarning, select_device
from bentray_kernels.refraction import Picture, RenderSettings, Scene, render
from bentray_kernels.refraction.caster_opencl import OpenCLCaster
from bentray_kernels.splines import Spline
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

from ..shared._timing import alternate
from ._refracting_ball import board, camera, scene, signed_distance

PIXELS = 512
PROCESSORS = len(os.sched_getaffinity(0))

# What a hand that turns an object expects, frames a second.
INTERACTIVE = 10.0

# Times the speed of the compiled caster on all processors: where the device is the processors themselves,
# whose vectors it hardly uses, and where it is another.
WORTH_SAME, WORTH_OTHER = 0.5, 1.0

# Pixels that may differ by more than one level of 255, %, by the precision of the rays.
ODD_PIXELS = {"float64": 0.02, "float32": 0.5}


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Frames a second and odd pixels for each precision; sampled after refraction."""
    made = scene(Spline(signed_distance()), 0.0)
    context.progress(0, 2, "trying the device")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", OpenCLFallbackWarning)
        casters = {precision: OpenCLCaster.on_the_device(made, precision) for precision in ODD_PIXELS}
        pictures = {
            precision: _frame(made, 1, caster)()
            for precision, caster in casters.items()
            if caster is not None
        }
    if caught:
        reason = "; ".join(str(remark.message) for remark in caught)
        yield from (
            Row(label, None, goal, op, unit, reason)
            for precision in ODD_PIXELS
            for label, goal, op, unit in _targets(precision)
        )
        return
    context.progress(1, 2, "rendering")
    single, all_of_them = "compiled, 1 thread", f"compiled, {PROCESSORS} threads"
    runs = {precision: _frame(made, 1, caster) for precision, caster in casters.items()}
    runs |= {single: _frame(made, 1, None), all_of_them: _frame(made, PROCESSORS, None)}
    seconds = alternate(runs, 5 if context.quick else 15)
    expected = runs[single]().image.astype(int)
    listed = ", ".join(f"{name} {1.0 / least:.1f}" for name, least in seconds.items())
    for precision, caster in casters.items():
        odd = np.abs(pictures[precision].image - expected).max(axis=2) > 1
        values = (
            (1.0 / seconds[precision], f"{caster.session.handle.name}; frames a second: {listed}"),
            (seconds[all_of_them] / seconds[precision], f"frames a second: {listed}"),
            (100.0 * odd.mean(), f"{odd.sum()} of {odd.size} differ by more than 1 of 255"),
        )
        for (label, goal, op, unit), (value, detail) in zip(_targets(precision), values, strict=True):
            yield Row(label, float(value), goal, op, unit, detail)
    context.progress(2, 2, "done")


def _targets(precision: str) -> tuple[tuple[str, float, str, str], ...]:
    """Label, goal, comparison and unit of the three rows of a precision."""
    name = f"V3 OpenCL {precision}, {PIXELS}²"
    device = select_device().device
    worth = WORTH_SAME if device is not None and device.kind == "cpu" else WORTH_OTHER
    return (
        (f"{name}, frames", INTERACTIVE, ">=", "1/s"),
        (f"{name}, over compiled on {PROCESSORS} processors", worth, ">=", ""),
        (f"{name}, odd pixels", ODD_PIXELS[precision], "<=", "%"),
    )


def _frame(made: Scene, threads: int, caster: OpenCLCaster | None) -> Callable[[], Picture]:
    settings = RenderSettings(PIXELS, PIXELS, threads=threads)
    return lambda: render(made, camera(), board(), settings, caster)

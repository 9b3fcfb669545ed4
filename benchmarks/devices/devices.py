"""Each engine on the OpenCL device beside compiled code, and whole reconstructions on it."""

from collections.abc import Iterable

from bentray_kernels.device_engines import ENGINES_COMPARED, Comparison, compare
from bentray_kernels.opencl import Device, select_device
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

from ._whole_runs import whole_runs

# Times the speed of compiled code, where the device is another one than the processor. Where it is the
# processor itself, its vectors are hardly used.
WORTH_OTHER, WORTH_SAME = 1.0, 0.5

# Time of one projection of 256² by the dissertation's Tesla, ms; frames of 512² asked for.
ONE_PROJECTION = "fast iterative method, 1 of"
THEIR_PROJECTION_MS, FRAMES_PER_S = 2.2, 60.0


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Rows for each engine: the speed over compiled code, the difference, a rate; and for whole runs."""
    choice = select_device()
    if choice.device is None:
        yield Row("D1 engines on a device", None, WORTH_OTHER, ">=", "", choice.reason)
        return
    for number, timed in enumerate(compare(context.quick)):
        context.progress(number + 1, ENGINES_COMPARED, timed.engine.name)
        yield from rows_of(timed, choice.device)
        yield from rates_of(timed, choice.device)
    yield from whole_runs(context, choice.device)


def rates_of(timed: Comparison, device: Device) -> Iterable[Row]:
    """Times and rates that have a goal of their own on a graphics card."""
    engine, seconds = timed.engine, timed.device_s
    if seconds is None:
        return
    where = f"{device.label}, driver {device.driver}"
    if engine.engine == "eikonal" and engine.name.startswith(ONE_PROJECTION):
        label = f"D1 {engine.name}, time"
        yield Row(
            label, 1e3 * seconds, THEIR_PROJECTION_MS, "<=", "ms", f"{where}; goal: their Tesla at 256²"
        )
    elif engine.engine == "refraction":
        label = f"D1 {engine.name}, frames per second"
        yield Row(label, 1.0 / seconds, FRAMES_PER_S, ">=", "1/s", where)


def rows_of(timed: Comparison, device: Device) -> Iterable[Row]:
    """The rows of an engine."""
    engine = timed.engine
    speed, difference = f"D1 {engine.name}, speed over compiled", f"D1 {engine.name}, difference"
    if timed.compiled_s is None or timed.device_s is None:
        reason = f"{device.label} computes it wrong"
        yield Row(speed, None, WORTH_OTHER, ">=", "", reason)
        yield Row(difference, None, engine.bound, "<=", engine.error.unit, reason)
        return
    share = timed.bandwidth_share
    threads = f"{engine.threads} thread{'s' if engine.threads > 1 else ''}"
    detail = (
        f"{device.label}: {1e3 * timed.device_s:.3g} ms, {engine.size / timed.device_s:.3g} {engine.unit} a "
        f"second{'' if share is None else f', {share:.2g} of the bandwidth of a copy'}; "
        f"compiled, {threads}: {1e3 * timed.compiled_s:.3g} ms"
    )
    worth = WORTH_SAME if device.kind == "cpu" else WORTH_OTHER
    yield Row(speed, timed.compiled_s / timed.device_s, worth, ">=", "", detail)
    yield Row(difference, timed.difference, engine.bound, "<=", engine.error.unit, device.label)

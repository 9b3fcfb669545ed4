"""Each engine on the OpenCL device beside compiled code: time, throughput and difference."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from bentray_kernels.opencl import Device, Session, choose
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

from ..eikonal.eikonal import alternate
from ._engines import Engine, engines

# Times the speed of compiled code in one thread, where the device is another one than the processor. Where it
# is the processor itself, its vectors are hardly used.
WORTH_OTHER, WORTH_SAME = 1.0, 0.5

REPEATS = 5


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Two rows for each engine: the speed over compiled code, and the difference of the results."""
    choice = choose()
    if choice.device is None:
        yield Row("D1 engines on a device", None, WORTH_OTHER, ">=", "", choice.reason)
        return
    limit = copied_bytes_per_s(choice.device, 2**22 if context.quick else 2**28)
    for number, engine in enumerate(engines(context.quick)):
        context.progress(number, 7, engine.name)
        if engine.there is not None:
            yield from measured(engine, choice.device, limit, 1 if context.quick else REPEATS)
        else:
            reason = f"{choice.device.label} computes it wrong"
            yield Row(f"D1 {engine.name}, speed over compiled", None, WORTH_OTHER, ">=", "", reason)
            yield Row(f"D1 {engine.name}, difference", None, engine.bound, "<=", engine.error_unit, reason)


def copied_bytes_per_s(device: Device, size_bytes: int) -> float:
    """Memory traffic of the device while it copies a buffer, the best of some runs."""
    # Imported here, for a machine without OpenCL.
    import pyopencl as cl

    session = Session(device)
    source, target = session.zeros(size_bytes // 4, np.float32), session.reserve(size_bytes)

    def copy() -> None:
        cl.enqueue_copy(session.queue, target, source, byte_count=size_bytes).wait()

    return 2.0 * size_bytes / alternate({"copy": copy}, REPEATS)["copy"]


def measured(engine: Engine, device: Device, limit: float, repeats: int) -> Iterable[Row]:
    """The rows of an engine that the device computes; ``limit`` is its memory traffic, bytes/s."""
    assert engine.there is not None
    seconds = alternate({"compiled": engine.here, "device": engine.there}, repeats)
    rate, traffic = engine.work / seconds["device"], engine.least_bytes / seconds["device"]
    detail = (
        f"{device.label}: {1e3 * seconds['device']:.3g} ms, {rate:.3g} {engine.unit} a second, "
        f"at least {1e-9 * traffic:.3g} GB/s, {100.0 * traffic / limit:.2g} % of a copy; "
        f"compiled, one thread: {1e3 * seconds['compiled']:.3g} ms"
    )
    worth = WORTH_SAME if device.kind == "cpu" else WORTH_OTHER
    gain = seconds["compiled"] / seconds["device"]
    yield Row(f"D1 {engine.name}, speed over compiled", gain, worth, ">=", "", detail)
    off = engine.error(engine.there(), engine.here())
    yield Row(f"D1 {engine.name}, difference", off, engine.bound, "<=", engine.error_unit, device.label)

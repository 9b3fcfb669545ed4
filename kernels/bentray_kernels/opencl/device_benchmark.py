"""Benchmark of a device: the time of an engine on it beside compiled code, cached as the self-test is."""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

from ..compilation.sources import digest
from .child_process import answers_of
from .devices import Device
from .records import read_record, record_file, write_record

# The engines that are tried, and the module that tries them. It imports every engine, so it is started as a
# process and never imported here.
ENGINES = ("eikonal", "wave", "sart", "reflection", "refraction", "field")
MODULE = "bentray_kernels.device_engines.benchmark_process"

# Of `bentray devices`, for one engine; the first run of an installation compiles kernels too.
TIME_OUT_S = 300.0

# Failed benchmarks of an engine after which it is tried only by `bentray devices`: the first ones may end
# while kernels are compiled, which are in the cache the next time.
MOST_ATTEMPTS = 3

# Takes a device, an engine and a time-out; returns the answers of the benchmark, and how it ended.
Child = Callable[[Device, str, float], tuple[list[dict[str, Any]], str]]


class Timing(NamedTuple):
    """One problem.

    Attributes:
        size: of the problem: nodes, node updates or rays.
        compiled_s: time of compiled code.
        device_s: time of the device.
    """

    size: float
    compiled_s: float
    device_s: float


@dataclass(frozen=True)
class DeviceBenchmark:
    """The times of an engine on a device.

    Attributes:
        timings: a small problem and a large one; none with a fault.
        fault: why the engine may not compute on the device; empty if it may.
        attempts: failed benchmarks before and with this one.
    """

    timings: tuple[Timing, ...] = ()
    fault: str = ""
    attempts: int = 0

    def faster(self, size: float) -> bool:
        """Whether the device takes less time than compiled code for a problem of that size."""
        if not self.timings:
            return False
        compiled = _seconds([(timing.size, timing.compiled_s) for timing in self.timings], size)
        return _seconds([(timing.size, timing.device_s) for timing in self.timings], size) < compiled


def _seconds(timings: Sequence[tuple[float, float]], size: float) -> float:
    """Time of a problem: a start and a time per unit, from the smallest and the largest known problem."""
    (small, first), (large, last) = min(timings), max(timings)
    each = max(0.0, (last - first) / (large - small)) if large > small else last / large
    start = max(0.0, first - each * small)
    return start + each * size


def stored_benchmark(device: Device, engine: str) -> DeviceBenchmark | None:
    """The benchmark in the cache; None if it is absent or damaged."""
    content = read_record(_file(device, engine))
    try:
        timings = tuple(Timing(*map(float, pair)) for pair in content["timings"])
        result = DeviceBenchmark(timings, str(content["fault"]), int(content["attempts"]))
    except (ValueError, KeyError, TypeError):
        return None
    numbers = [number for timing in timings for number in timing]
    whole = all(math.isfinite(number) and number > 0.0 for number in numbers)
    return result if whole and bool(timings) != bool(result.fault) else None


def benchmark_engine(device: Device, engine: str, time_out_s: float = TIME_OUT_S) -> DeviceBenchmark:
    """Try an engine in a child process, and store the benchmark."""
    result = examine(device, engine, in_a_child, time_out_s)
    write_record(_file(device, engine), asdict(result))
    return result


def benchmark_of(device: Device, engine: str) -> DeviceBenchmark:
    """The benchmark in the cache, or a new one without haste; a failed one is repeated."""
    stored = stored_benchmark(device, engine)
    return stored if stored is not None and not stored.fault else benchmark_engine(device, engine)


def examine(device: Device, engine: str, child: Child, time_out_s: float) -> DeviceBenchmark:
    """Try an engine; a device that ends or stops the child has a fault."""
    answers, ending = child(device, engine, time_out_s)
    answer = next((answer for answer in answers if answer.get("engine") == engine), {"fault": ending})
    if not answer["fault"]:
        return DeviceBenchmark(tuple(Timing(*map(float, pair)) for pair in answer["timings"]))
    before = stored_benchmark(device, engine)
    return DeviceBenchmark((), str(answer["fault"]), 1 + (before.attempts if before else 0))


def in_a_child(device: Device, engine: str, time_out_s: float) -> tuple[list[dict[str, Any]], str]:
    """Run ``device_engines.benchmark_process`` in a process of its own."""
    return answers_of(MODULE, device, (engine,), time_out_s)


def _file(device: Device, engine: str) -> Path | None:
    sources = sorted((Path(__file__).parent / "sources").rglob("*.cl"))
    contents = (digest(MODULE).encode(), *(file.read_bytes() for file in sources))
    return record_file(f"trial-{engine}", device, contents)

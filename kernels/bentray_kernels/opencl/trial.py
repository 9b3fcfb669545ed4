"""Trial of a device: the time of each engine on it beside compiled code, cached as the verdict is."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from ..sources import digest
from .child_process import answers_of
from .devices import Device
from .records import read_record, record_file, write_record

# The engines that are tried, and the module that tries them. It imports every engine, so it is started as a
# process and never imported here.
ENGINES = ("eikonal", "wave", "sart", "reflection", "refraction", "field")
MODULE = "bentray_kernels.device_engines.trial_process"

# Of all engines; the first run of an installation compiles kernels too.
TIME_OUT_S = 600.0

# Takes a device, engines and a time-out; returns the answers of the trial, and how it ended.
Child = Callable[[Device, Sequence[str], float], tuple[list[dict[str, Any]], str]]


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
class Trial:
    """The times of a device.

    Attributes:
        timings: by engine, a small problem and a large one.
        faults: by engine, why it may not compute on the device.
    """

    timings: Mapping[str, tuple[Timing, ...]]
    faults: Mapping[str, str]

    def faster(self, engine: str, size: float) -> bool:
        """Whether the device takes less time than compiled code for a problem of that size."""
        timings = self.timings.get(engine, ())
        if not timings or self.faults.get(engine):
            return False
        compiled = _seconds([(one.size, one.compiled_s) for one in timings], size)
        return _seconds([(one.size, one.device_s) for one in timings], size) < compiled


def _seconds(known: Sequence[tuple[float, float]], size: float) -> float:
    """Time of a problem: a start and a time per unit, from the smallest and the largest known problem."""
    (small, first), (large, last) = min(known), max(known)
    each = max(0.0, (last - first) / (large - small)) if large > small else last / large
    start = max(0.0, first - each * small)
    return start + each * size


@cache
def trial_of(device: Device) -> Trial:
    """The trial, in a child process or from the cache."""
    stored = stored_trial(device)
    if stored is not None:
        return stored
    trial = examine(device, in_a_child)
    if not trial.faults:
        with suppress(OSError, RuntimeError):
            write_record(_file(device), asdict(trial))
    return trial


def stored_trial(device: Device) -> Trial | None:
    """The trial in the cache; None if it is absent or damaged."""
    try:
        content = read_record(_file(device))
        timings = {
            engine: tuple(Timing(*map(float, one)) for one in content["timings"][engine])
            for engine in ENGINES
        }
        faults = {str(engine): str(fault) for engine, fault in content["faults"].items()}
    except (OSError, RuntimeError, ValueError, KeyError, TypeError, AttributeError):
        return None
    numbers = [number for engine in timings.values() for one in engine for number in one]
    whole = all(timings.values()) and all(math.isfinite(number) and number > 0.0 for number in numbers)
    return Trial(timings, faults) if whole else None


def examine(device: Device, child: Child) -> Trial:
    """Try every engine; if one ends or stops the child, the rest is tried in another one."""
    timings: dict[str, tuple[Timing, ...]] = {}
    faults: dict[str, str] = {}
    left = list(ENGINES)
    while left:
        answers, ending = child(device, left, TIME_OUT_S)
        for answer in answers:
            engine = answer.get("engine")
            if engine not in left:
                continue
            left.remove(engine)
            if answer["fault"]:
                faults[engine] = str(answer["fault"])
            else:
                timings[engine] = tuple(Timing(*map(float, one)) for one in answer["timings"])
        if left:
            faults[left.pop(0)] = ending
    return Trial(timings, faults)


def in_a_child(device: Device, engines: Sequence[str], time_out_s: float) -> tuple[list[dict[str, Any]], str]:
    """Run ``device_engines.trial_process`` in a process of its own."""
    return answers_of(MODULE, device, engines, time_out_s)


def _file(device: Device) -> Path:
    sources = sorted((Path(__file__).parent / "sources").rglob("*.cl"))
    return record_file("trial", device, (digest(MODULE).encode(), *(file.read_bytes() for file in sources)))

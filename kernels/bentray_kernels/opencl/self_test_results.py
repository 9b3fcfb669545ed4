"""Result of the self-test of a device, cached while driver, processor and program are unchanged."""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

from .child_process import answers_of
from .devices import Device
from .records import read_record, record_file, write_record
from .self_test import NEEDED, STAGES
from .session import WIDTHS

# Building all kernels takes seconds; the machine may be busy with starting workers.
TIME_OUT_S = 120.0

# Runs stages: takes device, stages and time-out; returns the faults of the completed stages.
Answers = dict[str, str]
Child = Callable[[Device, Sequence[str], float], tuple[Answers, str]]


@dataclass(frozen=True)
class SelfTestResult:
    """The test result of a device.

    Attributes:
        reason: of its rejection; empty if it may be used.
        widths: correct vector widths of doubles.
        faults: by stage of the self-test, including stages that the kernels do not need.
    """

    reason: str
    widths: tuple[int, ...]
    faults: dict[str, str]

    @property
    def usable(self) -> bool:
        return not self.reason


@cache
def self_test_result(device: Device, time_out_s: float = TIME_OUT_S) -> SelfTestResult:
    """The result, from the cache or from a self-test in a child process, which has so many seconds."""
    if not device.double_precision:
        return SelfTestResult("it has no double precision", (), {})
    stored = _kept(device)
    if stored is not None:
        return stored
    result = examine(device, in_a_child, time_out_s)
    if result.usable:
        # A failure may be due to a busy machine.
        write_record(_file(device), asdict(result))
    return result


def stored_self_test_result(device: Device) -> SelfTestResult | None:
    """The result in the cache, without a test; None without one."""
    return _kept(device) if device.double_precision else None


def examine(device: Device, child: Child, time_out_s: float = TIME_OUT_S) -> SelfTestResult:
    """Run all stages; if the device ends or stops the child, run the rest in another one, if in time."""
    faults: dict[str, str] = {}
    left = list(STAGES)
    end = time.monotonic() + time_out_s
    while left:
        answers, ending = child(device, left, end - time.monotonic())
        answers = {stage: answers[stage] for stage in left if stage in answers}
        faults.update(answers)
        left = [stage for stage in left if stage not in answers]
        if left:
            faults[left.pop(0)] = ending
        if any(faults.get(stage) for stage in NEEDED) or time.monotonic() >= end:
            break
    reason = next((f"{stage}: {faults[stage]}" for stage in NEEDED if faults.get(stage)), "")
    widths = tuple(w for w in WIDTHS if faults.get(f"double{w}") == "")
    return SelfTestResult(reason, widths, {stage: fault for stage, fault in faults.items() if fault})


def in_a_child(device: Device, stages: Sequence[str], time_out_s: float) -> tuple[Answers, str]:
    """Run ``self_test`` in a process of its own.

    Returns:
        The faults of the completed stages, and how the process ended in the next one.
    """
    answers, ending = answers_of(f"{__package__}.self_test", device, stages, time_out_s)
    faults = [answer for answer in answers if {"stage", "fault"} <= answer.keys()]
    return {str(answer["stage"]): str(answer["fault"]) for answer in faults}, ending


def _file(device: Device) -> Path | None:
    package = Path(__file__).parent
    names = ("self_test.py", "blocks.py", "session.py", "program.py", "pocl.py", "link/shared_library.py")
    sources = (*(package / name for name in names), *sorted((package / "sources").rglob("*.cl")))
    return record_file("opencl", device, (source.read_bytes() for source in sources))


def _kept(device: Device) -> SelfTestResult | None:
    try:
        content = read_record(_file(device))
        widths = tuple(int(width) for width in content["widths"])
        return SelfTestResult("", widths, {str(k): str(v) for k, v in content["faults"].items()})
    except (ValueError, KeyError, TypeError, AttributeError):
        return None

"""Result of the self-test of a device, cached while driver, processor and program are unchanged."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from importlib import resources
from pathlib import Path

from .devices import Device
from .processor import processor
from .self_test import NEEDED, STAGES, WIDTHS

# Building all kernels takes seconds; the machine may be busy with starting workers.
TIME_OUT_S = 120.0

# Runs stages: takes device, stages and time-out; returns the faults of the completed stages.
Answers = dict[str, str]
Child = Callable[[Device, Sequence[str], float], tuple[Answers, str]]


@dataclass(frozen=True)
class Verdict:
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
def verdict_on(device: Device) -> Verdict:
    """The verdict, from a self-test in a child process or from the cache."""
    if not device.double_precision:
        return Verdict("it has no double precision", (), {})
    stored = _kept(device)
    if stored is not None:
        return stored
    verdict = examine(device, in_a_child)
    if verdict.usable:
        _keep(device, verdict)
    return verdict


def examine(device: Device, child: Child) -> Verdict:
    """Run all stages; if the device ends or stops the child, run the rest in another one."""
    faults: dict[str, str] = {}
    left = list(STAGES)
    while left:
        answers, ending = child(device, left, TIME_OUT_S)
        answers = {stage: answers[stage] for stage in left if stage in answers}
        faults.update(answers)
        left = [stage for stage in left if stage not in answers]
        if left:
            faults[left.pop(0)] = ending
        if any(faults.get(stage) for stage in NEEDED):
            break
    reason = next((f"{stage}: {faults[stage]}" for stage in NEEDED if faults.get(stage)), "")
    widths = tuple(w for w in WIDTHS if faults.get(f"double{w}") == "")
    return Verdict(reason, widths, {stage: fault for stage, fault in faults.items() if fault})


def in_a_child(device: Device, stages: Sequence[str], time_out_s: float) -> tuple[Answers, str]:
    """Run ``self_test`` in a process of its own.

    Returns:
        The faults of the completed stages, and how the process ended in the next one.
    """
    command = [sys.executable, "-m", f"{__package__}.self_test", str(device.index), device.label, *stages]
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as errors:
        try:
            code = subprocess.run(  # noqa: S603 - our own module
                command, stdout=out, stderr=errors, stdin=subprocess.DEVNULL, timeout=time_out_s, check=False
            ).returncode
            ending = f"ended by signal {-code}" if code < 0 else f"ended with exit code {code}"
        except subprocess.TimeoutExpired:
            ending = f"no answer in {time_out_s:g} s"
        out.seek(0)
        errors.seek(0)
        said = errors.read().strip().splitlines() or [""]
        # The error of a compiler is more useful than the last line, which may be a remark.
        last = ([line for line in said if "error:" in line.lower()] or said)[-1].strip()
        answers: Answers = {}
        for line in out.read().splitlines():
            try:
                answer = json.loads(line)
                answers[str(answer["stage"])] = str(answer["fault"])
            except (ValueError, KeyError, TypeError):  # a driver's own remark
                continue
    return answers, f"{ending} ({last[:200]})" if last else ending


def _file(device: Device) -> Path:
    """File of the cached verdict; driver, processor, program and self-test determine its name."""
    # Hosts with a common home may have different processors of the same generic name.
    digest = hashlib.sha256(repr((device, platform.machine(), sorted(processor()))).encode())
    package = resources.files(__package__)
    for name in ("self_test.py", "blocks.py", "session.py", "pocl.py", "link/shared_library.py"):
        digest.update(package.joinpath(name).read_bytes())
    for source in sorted(Path(str(package / "sources")).rglob("*.cl")):
        digest.update(source.read_bytes())
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return home / "bentray" / f"opencl-{digest.hexdigest()[:32]}.json"


def _kept(device: Device) -> Verdict | None:
    try:
        content = json.loads(_file(device).read_text())
        widths = tuple(int(width) for width in content["widths"])
        return Verdict("", widths, {str(k): str(v) for k, v in content["faults"].items()})
    except (OSError, RuntimeError, ValueError, KeyError, TypeError, AttributeError):
        return None


def _keep(device: Device, verdict: Verdict) -> None:
    """Store only success: a failure may be due to a busy machine."""
    try:
        file = _file(device)
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile("w", dir=file.parent, delete=False) as partial:
            json.dump(asdict(verdict), partial)
        Path(partial.name).replace(file)
    except (OSError, RuntimeError):  # no home to write to: the next process tries the device again
        return

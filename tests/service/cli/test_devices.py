"""`bentray devices` says what there is, what is refused and why, and what is used."""

from __future__ import annotations

import json
from collections.abc import Callable

import pytest
from typer.testing import Result

from bentray_kernels import opencl
from bentray_kernels.opencl import Choice, Device, Verdict

GPU = Device(0, "Fast Platform", "GPU 9000", "gpu", "OpenCL 3.0", "1.2.3", True)
CPU = Device(1, "Slow Platform", "Processor", "cpu", "OpenCL 3.0", "3.0-rc2", True)


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """A GPU that computes wrongly and a processor that cannot do wide vectors."""
    verdicts = {
        GPU: Verdict("solve: wrong travel times in 2-D", (1, 2), {"solve": "wrong travel times in 2-D"}),
        CPU: Verdict("", (1, 2, 4), {"double8": "ended by signal 6"}),
    }
    monkeypatch.setattr(opencl, "find_devices", lambda: (GPU, CPU))
    monkeypatch.setattr(opencl, "verdict_on", verdicts.__getitem__)
    monkeypatch.setattr(opencl, "choose", lambda: Choice(CPU, ("GPU 9000 was refused",)))


def test_each_device_has_its_verdict_and_reason(bentray: Callable[..., Result], machine: None) -> None:
    result = bentray("devices")
    assert result.exit_code == 0
    words = " ".join(result.stdout.replace("│", " ").split())
    assert "refused" in words
    assert "wrong travel" in words
    assert "double8" in words
    assert result.stdout.splitlines()[-1] == "fim-opencl uses device 1, Slow Platform:Processor"


def test_json_has_every_figure(bentray: Callable[..., Result], machine: None) -> None:
    figures = json.loads(bentray("devices", "--json").stdout)
    assert figures["chosen"] == 1
    gpu, cpu = figures["devices"]
    assert (gpu["usable"], gpu["reason"]) == (False, "solve: wrong travel times in 2-D")
    assert (cpu["usable"], cpu["widths"], cpu["driver"]) == (True, [1, 2, 4], "3.0-rc2")
    assert cpu["faults"] == {"double8": "ended by signal 6"}


def test_without_devices_the_way_out_is_said(
    bentray: Callable[..., Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(opencl, "find_devices", tuple)
    monkeypatch.setattr(opencl, "choose", lambda: Choice(None, ()))
    assert bentray("devices").stdout == "no OpenCL device found; fim-opencl computes without OpenCL, as fim\n"
    assert json.loads(bentray("devices", "--json").stdout) == {"chosen": None, "devices": []}


def test_a_wish_that_fits_nothing_lists_what_there_is(
    bentray: Callable[..., Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("BENTRAY_OPENCL_DEVICE", "no such device")
    result = bentray("devices")
    assert result.exit_code == 2
    assert result.stderr.startswith("bentray: BENTRAY_OPENCL_DEVICE: found 'no such device'")

"""`bentray devices` lists devices, rejected ones with the reason, and the one in use."""

import json
import warnings

import pytest

from bentray_kernels import opencl
from bentray_kernels.opencl import (
    Device,
    DeviceBenchmark,
    DeviceSelection,
    OpenCLFallbackWarning,
    SelfTestResult,
)
from bentray_kernels.opencl.device_benchmark import Timing
from bentray_service.cli import devices
from bentray_service.cli.output.terminal import show_warnings_on_one_line

from .conftest import Run

GPU = Device(0, "Fast Platform", "GPU 9000", "gpu", "OpenCL 3.0", "1.2.3", True, "/usr/lib/libfast.so.1")
CPU = Device(
    1, "Slow Platform", "Processor", "cpu", "OpenCL 3.0", "3.0-rc2", True, "/site/libslow.so", "slow 3.0"
)


@pytest.fixture(autouse=True)
def _nothing_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("BENTRAY_DEVICE", raising=False)


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """A GPU that computes wrongly and a processor that cannot do wide vectors."""
    verdicts = {
        GPU: SelfTestResult(
            "solve: wrong travel times in 2-D", (1, 2), {"solve": "wrong travel times in 2-D"}
        ),
        CPU: SelfTestResult("", (1, 2, 4), {"double8": "ended by signal 6"}),
    }
    monkeypatch.setattr(opencl, "find_devices", lambda: (GPU, CPU))
    monkeypatch.setattr(opencl, "self_test_result", verdicts.__getitem__)
    monkeypatch.setattr(opencl, "select_device", lambda: DeviceSelection(CPU, ("GPU 9000 was refused",)))
    right, wrong = (
        DeviceBenchmark((Timing(1e3, 0.01, 0.02), Timing(1e5, 1.0, 0.5))),
        DeviceBenchmark((), "ended by signal 6", 1),
    )
    monkeypatch.setattr(opencl, "benchmark_of", lambda device, engine: wrong if engine == "wave" else right)


def test_each_device_has_its_verdict_and_reason(bentray: Run, machine: None) -> None:
    result = bentray("devices")
    words = " ".join(result.stdout.replace("│", " ").split())
    assert "refused" in words
    assert "wrong travel" in words
    assert "double8" in words
    lines = result.stdout.splitlines()
    assert "device 0 comes from /usr/lib/libfast.so.1" in lines
    assert "device 1 comes from slow 3.0: /site/libslow.so" in lines
    assert lines[-1] == "chosen: device 1, Slow Platform:Processor"


def test_the_trial_shows_what_auto_takes(bentray: Run, machine: None) -> None:
    rows = [line.replace("│", " ").split() for line in bentray("devices").stdout.splitlines()]
    assert ["refraction", "1,000", "10", "ms", "20", "ms", "compiled"] in rows
    assert ["refraction", "100,000", "1e+03", "ms", "500", "ms", "device"] in rows
    assert ["wave", "ended", "by", "signal", "6", "compiled"] in rows


def test_json_has_every_figure(bentray: Run, machine: None) -> None:
    figures = json.loads(bentray("devices", "--json").stdout)
    assert figures["chosen"] == 1
    gpu, cpu = figures["devices"]
    assert (gpu["usable"], gpu["reason"]) == (False, "solve: wrong travel times in 2-D")
    assert (cpu["usable"], cpu["widths"], cpu["driver"]) == (True, [1, 2, 4], "3.0-rc2")
    assert (cpu["library"], cpu["package"]) == ("/site/libslow.so", "slow 3.0")
    assert (figures["reason"], figures["help"]) == ("", "")
    assert cpu["faults"] == {"double8": "ended by signal 6"}
    assert figures["trial"]["refraction"][1] == {"size": 1e5, "compiled_s": 1.0, "device_s": 0.5}
    assert figures["trial_faults"] == {"wave": "ended by signal 6"}


def test_without_devices_a_remedy_is_shown(bentray: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(opencl, "find_devices", tuple)
    monkeypatch.setattr(opencl, "select_device", lambda: DeviceSelection(None, ()))
    monkeypatch.delenv("BENTRAY_OPENCL_DEVICE", raising=False)
    monkeypatch.setattr(devices.shutil, "which", lambda name: f"/usr/bin/{name}")
    first, second = bentray("devices").stdout.splitlines()
    assert first == "this machine has no OpenCL device; compiled code computes everything"
    assert second.startswith("suggestion: ")
    assert "apt-get install pocl-opencl-icd" in second
    figures = json.loads(bentray("devices", "--json").stdout)
    assert (figures["chosen"], figures["devices"]) == (None, [])
    assert figures["help"] == second.removeprefix("suggestion: ")


@pytest.mark.parametrize(
    ("machine", "command"),
    [("x86_64", "-m pip install intel-opencl-rt intel-cmplr-lib-rt "), ("aarch64", "install PoCL with ")],
)
def test_where_all_are_rejected_one_command_helps(
    bentray: Run, monkeypatch: pytest.MonkeyPatch, machine: str, command: str
) -> None:
    monkeypatch.delenv("BENTRAY_OPENCL_DEVICE", raising=False)
    monkeypatch.setattr(opencl, "find_devices", lambda: (CPU,))
    refused = SelfTestResult(
        "double1: unknown target CPU 'generic'", (), {"double1": "unknown target CPU 'generic'"}
    )
    monkeypatch.setattr(opencl, "self_test_result", lambda device: refused)
    monkeypatch.setattr(
        opencl, "select_device", lambda: DeviceSelection(None, ("Slow Platform:Processor was refused",))
    )
    monkeypatch.setattr(devices.shutil, "which", lambda name: None)
    monkeypatch.setattr(devices.platform, "machine", lambda: machine)
    lines = bentray("devices").stdout.splitlines()
    assert lines[-2] == "no device passed; compiled code computes everything"
    assert command in lines[-1]
    assert "double1: unknown" in " ".join(bentray("devices").stdout.replace("│", " ").split())


@pytest.mark.parametrize(("name", "value"), [("BENTRAY_OPENCL_DEVICE", "none"), ("BENTRAY_DEVICE", "cpu")])
def test_hidden_devices_are_reported(
    bentray: Run, monkeypatch: pytest.MonkeyPatch, name: str, value: str
) -> None:
    monkeypatch.setenv(name, value)
    first, second = bentray("devices").stdout.splitlines()
    assert first.startswith(f"{name}={value} hides every device; ")
    assert second.startswith(f"suggestion: unset {name} ")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("BENTRAY_DEVICE", "found 'gpu'; accepted: one of auto, cpu, opencl\n"),
        ("BENTRAY_OPENCL_DEVICE", "found 'gpu'"),
    ],
)
def test_an_unknown_request_of_the_machine_is_rejected(
    bentray: Run, monkeypatch: pytest.MonkeyPatch, name: str, said: str
) -> None:
    monkeypatch.setenv(name, "gpu")
    result = bentray("devices", code=2)
    assert result.stderr.startswith(f"bentray: {name}: {said}")


def test_that_another_method_takes_over_is_one_line_on_stderr(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    others: list[object] = []
    monkeypatch.setattr(warnings, "showwarning", lambda message, *more: others.append(message))
    show_warnings_on_one_line()
    warnings.showwarning(
        "no OpenCL device can be used, fim takes over", OpenCLFallbackWarning, "device_selection.py", 1
    )
    warnings.showwarning("of a library", DeprecationWarning, "library.py", 2)
    assert capsys.readouterr().err == "bentray: warning: no OpenCL device can be used, fim takes over\n"
    assert others == ["of a library"]

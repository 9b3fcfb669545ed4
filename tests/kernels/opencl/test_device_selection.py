"""Devices are found and chosen: the first that passes its self-test, or the requested one, opened once."""

import subprocess
import sys
import warnings
from dataclasses import replace

import pyopencl as cl
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.opencl import OpenCLFallbackWarning, Session, device_selection
from bentray_kernels.opencl.devices import find_devices, handle_of, select_devices
from bentray_kernels.opencl.self_test_results import SelfTestResult


@pytest.fixture
def verdicts(monkeypatch, three, fresh):
    """The three devices of a machine; set a reason by index to have one refused."""
    reasons = {}
    monkeypatch.setattr(device_selection, "find_devices", lambda: three)
    monkeypatch.setattr(
        device_selection,
        "self_test_result",
        lambda device: SelfTestResult(reasons.get(device.index, ""), (1,), {}),
    )
    return reasons


def test_the_first_gpu_that_passes_is_chosen(verdicts):
    assert device_selection.select_device().device.index == 1
    verdicts[1] = "solve: ended by signal 11"
    device = device_selection.select_device()
    assert device.device.index == 2
    assert device.refusals == ("Fast Platform:GPU 9000 was refused: solve: ended by signal 11",)


def test_requested_device_is_not_replaced(verdicts, monkeypatch):
    monkeypatch.setenv("BENTRAY_OPENCL_DEVICE", "9001")
    assert device_selection.select_device().device.index == 2
    verdicts[2] = "double1: wrong sqrt"
    assert device_selection.select_device().device is None


def test_rejects_an_unknown_device(verdicts, monkeypatch):
    monkeypatch.setenv("BENTRAY_OPENCL_DEVICE", "nvidia")
    with pytest.raises(InvalidInput, match="2 = Fast Platform:GPU 9001"):
        device_selection.session_or_warning("fim")


def test_the_warning_comes_once_and_names_every_refusal(verdicts):
    verdicts.update({0: "double1: wrong sqrt", 1: "no answer in 120 s", 2: "solve: ended by signal 6"})
    with pytest.warns(OpenCLFallbackWarning) as caught:
        assert device_selection.session_or_warning("fim") is None
    (message,) = [str(warning.message) for warning in caught]
    assert message.startswith("no OpenCL device can be used, fim takes over: ")
    assert all(reason in message for reason in verdicts.values())
    assert "bentray devices" in message
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert device_selection.session_or_warning("fim") is None


def test_a_warning_made_an_error_is_raised_each_time(verdicts, monkeypatch):
    monkeypatch.setattr(device_selection, "find_devices", tuple)
    for _ in range(2):
        with pytest.raises(OpenCLFallbackWarning, match="this machine has no OpenCL device"):
            device_selection.session_or_warning("fim")


@pytest.mark.opencl
def test_the_chosen_device_is_opened_once(fresh):
    first = device_selection.session_or_warning("fim")
    assert isinstance(first, Session)
    assert device_selection.session_or_warning("fim") is first


def test_gpus_come_first_by_default(three):
    for selection in (None, ""):
        assert [device.index for device in select_devices(three, selection)] == [1, 2, 0]


@pytest.mark.parametrize(
    ("selection", "index"), [("0", 0), (" 2 ", 2), ("9001", 2), ("slow platform:proc", 0), ("PROCESSOR", 0)]
)
def test_device_is_selected_by_index_or_part_of_its_name(three, selection, index):
    assert [device.index for device in select_devices(three, selection)] == [index]


@pytest.mark.parametrize(
    ("selection", "fits"), [("GPU", 2), ("fast", 2), ("3", 0), ("nvidia", 0), ("-1", 0), ("1.0", 0)]
)
def test_ambiguous_or_unknown_selection_lists_the_devices(three, selection, fits):
    with pytest.raises(InvalidInput, match="BENTRAY_OPENCL_DEVICE") as refusal:
        select_devices(three, selection)
    assert f"{selection!r}, which fits {fits} devices" in str(refusal.value)
    assert "0 = Slow Platform:Processor; 1 = Fast Platform:GPU 9000; 2 = Fast Platform:GPU 9001" in str(
        refusal.value
    )


def test_a_selection_without_devices_is_rejected():
    with pytest.raises(InvalidInput, match="there is none here"):
        select_devices((), "nvidia")


def test_no_platform_is_no_device(monkeypatch):
    def none():
        raise cl.LogicError("clGetPlatformIDs failed: PLATFORM_NOT_FOUND_KHR")

    monkeypatch.setattr(cl, "get_platforms", none)
    assert find_devices() == ()


def test_no_loader_is_no_device(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyopencl", None)
    assert find_devices() == ()


@pytest.mark.opencl
def test_a_platform_without_devices_hides_no_other(monkeypatch):
    class Empty:
        def get_devices(self):
            raise cl.RuntimeError("clGetDeviceIDs failed: DEVICE_NOT_FOUND")

    platforms = cl.get_platforms()
    monkeypatch.setattr(cl, "get_platforms", lambda: [Empty(), *platforms])
    assert len(find_devices()) > 0


@pytest.mark.opencl
def test_a_found_device_leads_to_its_handle_until_devices_change():
    for device in find_devices():
        assert handle_of(device).name.strip() == device.name
        for other in (replace(device, index=99), replace(device, driver="another")):
            with pytest.raises(LookupError, match="no longer"):
                handle_of(other)


def test_solvers_import_opencl_only_on_request():
    code = "import sys, bentray_kernels.eikonal as e; e.methods(); print('pyopencl' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"

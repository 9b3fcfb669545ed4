"""Selection of the OpenCL device: the first that passes its self-test, opened once."""

import warnings

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.opencl import OpenCLFallbackWarning, Session, device_selection
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

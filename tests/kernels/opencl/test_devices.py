"""Devices are found without fuss and chosen without doubt."""

import subprocess
import sys
from dataclasses import replace

import pyopencl as cl
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.opencl.devices import find_devices, handle_of, select_devices


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

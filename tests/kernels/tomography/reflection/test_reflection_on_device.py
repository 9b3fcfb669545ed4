"""A reflection image with the setting device: on the device it is that of compiled code, and says so."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.opencl.lost_device import DeviceLostError
from bentray_kernels.tomography import reconstruct
from bentray_kernels.tomography.reflection import reflection_graph
from bentray_kernels.tomography.settings import Settings
from bentray_kernels.tomography.solver_choice import echo_engine, needs_device

from .test_reflection_graph import SETTINGS as BY_SART
from .test_reflection_graph import scan

# SART would be on the device too.
SETTINGS = BY_SART.changed(method="gauss-newton")
ON_DEVICE = SETTINGS.changed(device="opencl")


@pytest.mark.opencl
def test_the_image_on_a_device_is_that_of_compiled_code():
    here, there = (reconstruct(scan(), plan) for plan in (SETTINGS, ON_DEVICE))
    assert here.reflection.db.min() == -100.0
    loud = here.reflection.db > -60.0
    assert np.abs(there.reflection.db - here.reflection.db)[loud].max() < 0.05
    assert there.provenance["reflection"].endswith("; echoes summed on OpenCL devices")
    assert "OpenCL" not in here.provenance["reflection"]
    np.testing.assert_array_equal(reconstruct(scan(), ON_DEVICE).reflection.db, there.reflection.db)


@pytest.mark.opencl
def test_a_device_that_fails_leaves_the_sums_to_compiled_code(monkeypatch):
    calls = []

    def failing(*given):
        calls.append(len(given))
        if len(calls) % 2:
            raise DeviceLostError("broken")
        return reflection_graph.sum_echoes(*given)

    monkeypatch.setattr(reflection_graph, "sum_echoes_opencl", failing)
    result = reconstruct(scan(), ON_DEVICE).reflection.db
    assert len(calls) % 2 == 0
    assert calls
    np.testing.assert_array_equal(result, reconstruct(scan(), SETTINGS).reflection.db)


def test_only_a_reflection_image_on_opencl_needs_the_device():
    plain = Settings(method="gauss-newton", device="opencl")
    assert (echo_engine(ON_DEVICE), needs_device(ON_DEVICE)) == ("opencl", True)
    for plan_of in (SETTINGS, ON_DEVICE.changed(device="auto"), ON_DEVICE.changed(device="cpu"), plain):
        assert echo_engine(plan_of) == "compiled"
    assert not needs_device(SETTINGS)
    assert replace(plain, device="cpu").device == "cpu"

"""Without an OpenCL device there is no caster on one, and a warning says so."""

import pytest

from bentray_kernels.opencl import OpenCLFallbackWarning, device_selection
from bentray_kernels.refraction import Layers, Scene
from bentray_kernels.refraction.caster_opencl import OpenCLCaster
from bentray_kernels.splines import Spline

from .solids import distance


def test_without_a_device_there_is_no_caster(monkeypatch):
    monkeypatch.setattr(device_selection, "_found", lambda *_: "this machine has no OpenCL device")
    device_selection._warn_once.cache_clear()
    ball = Scene.build(Spline(0.3 - distance(12)), Layers((0.0,), (1.0, 1.5)), 1.0 / 11)
    with pytest.warns(OpenCLFallbackWarning, match="takes over: this machine has no"):
        assert OpenCLCaster.on_the_device(ball) is None
    device_selection._warn_once.cache_clear()

"""The time step on OpenCL: the traces of the compiled one; without a device a warning and the same traces."""

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.opencl import OpenCLFallbackWarning, choice
from bentray_kernels.wave.medium import Medium
from bentray_kernels.wave.simulation import simulate
from bentray_kernels.wave.simulation_opencl import simulate_opencl

TIME = np.arange(200) * 2e-7
WAVELET = 3e4 * np.exp(-(((TIME - 6e-6) * 2e5) ** 2)) * np.sin(2.0 * np.pi * 2e5 * (TIME - 6e-6))
EMITTER = np.array([0.0123, 0.0201])
RECEIVERS = np.array([[0.0301, 0.0311], [0.0202, 0.0352], [0.031, 0.012]])


def medium(dtype):
    speed = np.random.default_rng(0).uniform(1400.0, 1600.0, (40, 45))
    loss = np.random.default_rng(1).uniform(0.0, 20.0, speed.shape)
    return Medium.of(speed, 1e-3, 2e-7, attenuation=loss, edge_nodes=8, dtype=dtype)


@pytest.mark.opencl
@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 1e-12), (np.float32, 1e-5)])
def test_traces_are_those_of_the_compiled_step(dtype, tolerance):
    host = medium(dtype)
    expected = simulate(host, EMITTER, RECEIVERS, WAVELET)
    found = simulate_opencl(host, EMITTER, RECEIVERS, WAVELET)
    assert found.dtype == dtype
    assert np.abs(found - expected).max() < tolerance * np.abs(expected).max()


def test_without_a_device_the_cpu_computes_with_a_warning(monkeypatch):
    monkeypatch.setattr(choice, "find_devices", list)
    choice._found.cache_clear()
    choice._warn_once.cache_clear()
    host = medium(np.float32)
    try:
        with pytest.warns(OpenCLFallbackWarning, match="compiled code"):
            found = simulate_opencl(host, EMITTER, RECEIVERS, WAVELET)
    finally:
        choice._found.cache_clear()
        choice._warn_once.cache_clear()
    assert np.array_equal(found, simulate(host, EMITTER, RECEIVERS, WAVELET))


def test_bad_elements_are_rejected_as_on_the_cpu():
    with pytest.raises(InvalidInput, match="element_position_m"):
        simulate_opencl(medium(np.float32), EMITTER, RECEIVERS + 1.0, WAVELET)

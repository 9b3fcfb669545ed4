"""3-D emissions on OpenCL: traces of compiled code, gradients of finite differences, checkpoints."""

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.opencl import session_or_warning
from bentray_kernels.wave.device_shots import ShotBatch
from bentray_kernels.wave.device_waves import OTHER_GROUP, DeviceWaves, Scan
from bentray_kernels.wave.emissions import Emissions, misfit_gradients, simulate_emissions
from bentray_kernels.wave.medium import Medium
from bentray_kernels.wave.simulation import place_elements, simulate
from bentray_kernels.wave.time_blocks import no_poll

SPACING, STEP, STEPS, SHAPE = 1e-3, 2e-7, 70, (13, 15, 18)
TIME = np.arange(STEPS) * STEP
WAVELET = 3e4 * np.exp(-(((TIME - 4e-6) * 3e5) ** 2)) * np.sin(2.0 * np.pi * 2e5 * (TIME - 4e-6))
EMITTERS = np.array([[0.0031, 0.0042, 0.0123], [0.0088, 0.0101, 0.0049]])
RECEIVERS = np.array([[0.0093, 0.0112, 0.0031], [0.0021, 0.0131, 0.0155], [0.0102, 0.0113, 0.0037]])
EMISSIONS = Emissions(EMITTERS, RECEIVERS, [np.arange(3), np.array([1])], WAVELET)


def medium(dtype, by=None, change=0.0):
    speed = 1500.0 + 40.0 * np.random.default_rng(0).standard_normal(SHAPE)
    loss = np.random.default_rng(1).uniform(30.0, 60.0, SHAPE)
    if by == "speed":
        # The gradient by speed holds the damping in time, not over distance.
        speed, loss = speed + change, loss * speed / (speed + change)
    elif by == "attenuation":
        loss = loss + change
    return Medium.from_speed(speed, SPACING, STEP, attenuation=loss, edge_nodes=5, dtype=dtype)


def energy(k, traces):
    return 0.5 * float((traces**2).sum()), traces


@pytest.mark.opencl
@pytest.mark.parametrize(("dtype", "bound"), [(np.float64, 1e-12), (np.float32, 1e-5)])
def test_traces_are_those_of_the_compiled_engine(dtype, bound):
    host = medium(dtype)
    for k, traces in enumerate(simulate_emissions(host, EMISSIONS, engine="opencl")):
        expected = simulate(host, EMITTERS[k], RECEIVERS[EMISSIONS.valid[k]], WAVELET)
        assert traces.dtype == dtype
        assert np.abs(traces - expected).max() < bound * np.abs(expected).max()


@pytest.mark.opencl
@pytest.mark.parametrize(("by", "small"), [("speed", 0.1), ("attenuation", 0.1)])
def test_gradient_is_that_of_finite_differences(by, small):
    way = np.random.default_rng(2).standard_normal(SHAPE)
    for axis in range(3):
        way.swapaxes(0, axis)[[0, -1]] = 0.0

    def value(factor):
        traces = simulate_emissions(medium(np.float64, by, factor * small * way), EMISSIONS, engine="opencl")
        return sum(energy(0, trace)[0] for trace in traces)

    parts = list(misfit_gradients(medium(np.float64), EMISSIONS, energy, by=by, engine="opencl"))
    near, far = ((value(k) - value(-k)) / (2.0 * k * small) for k in (1, 2))
    result = sum((part.gradient * way).sum() for part in parts)
    assert result == pytest.approx((4.0 * near - far) / 3.0, rel=1e-6)
    cheap = list(misfit_gradients(medium(np.float32), EMISSIONS, energy, by=by, engine="opencl"))
    for first, other in zip(cheap, parts, strict=True):
        assert np.abs(first.gradient - other.gradient).max() < 1e-4 * np.abs(other.gradient).max()


@pytest.mark.opencl
@pytest.mark.parametrize("segments", [2, 5])
def test_divided_time_loops_give_the_bits_of_whole_ones(segments):
    host = medium(np.float32)
    scan = Scan(place_elements(host, RECEIVERS), STEPS, 3)
    results = []
    for group, number in ((None, 1), (OTHER_GROUP, segments)):
        waves = DeviceWaves(session_or_warning(""), host, scan, group)
        batch = ShotBatch(waves, place_elements(host, EMITTERS), WAVELET / 3e4, number, no_poll)
        # The traces are the residuals.
        batch.forward()
        results.append((batch.traces(), *batch.backward()))
    for whole, divided in zip(*results, strict=True):
        assert whole.any()
        assert np.array_equal(whole, divided)


def test_compiled_code_has_no_gradient_in_3d():
    with pytest.raises(InvalidInput, match="speed"):
        list(misfit_gradients(medium(np.float32), EMISSIONS, energy))
    host = medium(np.float32)
    for k, traces in enumerate(simulate_emissions(host, EMISSIONS)):
        expected = simulate(host, EMITTERS[k], RECEIVERS[EMISSIONS.valid[k]], WAVELET)
        assert np.array_equal(traces, expected)

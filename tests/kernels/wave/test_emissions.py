"""Many emissions on OpenCL: traces and gradients of compiled code, whatever is in flight together."""

import itertools
import math

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.opencl import OpenCLFallbackWarning, choice, session_or_warning
from bentray_kernels.wave.device_waves import OTHER_GROUP, PROCESSOR_GROUP, DeviceWaves, Scan
from bentray_kernels.wave.emissions import misfit_gradients, simulate_emissions
from bentray_kernels.wave.medium import Medium
from bentray_kernels.wave.points import Points
from bentray_kernels.wave.simulation import place_elements, simulate
from bentray_kernels.wave.time_blocks import no_poll

from .emissions_scan import (
    EMISSIONS,
    EMITTERS,
    RECEIVERS,
    STEPS,
    VALID,
    WAVELET,
    change,
    compare,
    medium,
)

ENGINES = ("compiled", "opencl")


def gradients(host, misfit, engine, every=1, by="speed", **options):
    return list(misfit_gradients(host, EMISSIONS, misfit, every, by, engine=engine, **options))


def off(found, expected):
    return np.abs(found - expected).max() / np.abs(expected).max()


@pytest.fixture(scope="module")
def recorded():
    return list(simulate_emissions(medium(seed=5), EMISSIONS))


@pytest.mark.opencl
@pytest.mark.parametrize(("dtype", "bound"), [(np.float64, 1e-12), (np.float32, 1e-5)])
def test_traces_are_those_of_the_compiled_engine(dtype, bound):
    host = medium(dtype)
    found = list(simulate_emissions(host, EMISSIONS, engine="opencl"))
    assert len(found) == len(EMITTERS)
    for k, traces in enumerate(found):
        expected = simulate(host, EMITTERS[k], RECEIVERS[VALID[k]], WAVELET)
        assert traces.dtype == dtype
        assert traces.shape == expected.shape
        assert off(traces, expected) < bound


def test_compiled_engine_gives_the_traces_of_single_emissions():
    host = medium()
    for k, traces in enumerate(simulate_emissions(host, EMISSIONS)):
        assert np.array_equal(traces, simulate(host, EMITTERS[k], RECEIVERS[VALID[k]], WAVELET))


@pytest.mark.opencl
@pytest.mark.parametrize("by", ["speed", "attenuation"])
@pytest.mark.parametrize(("dtype", "every", "bound"), [(np.float64, 1, 1e-11), (np.float32, 4, 1e-4)])
def test_gradients_are_those_of_the_compiled_engine(by, dtype, every, bound, recorded):
    host, misfit = medium(dtype), compare(recorded)
    both = [gradients(host, misfit, engine, every, by) for engine in ENGINES]
    for expected, found in zip(*both, strict=True):
        assert found.misfit == pytest.approx(expected.misfit, rel=bound)
        assert off(found.gradient, expected.gradient) < bound
        assert off(found.illumination, expected.illumination) < bound


@pytest.mark.opencl
@pytest.mark.parametrize("by", ["speed", "attenuation"])
@pytest.mark.parametrize(("dtype", "small", "bound"), [(np.float64, 3e-2, 1e-6), (np.float32, 3.0, 1e-2)])
def test_gradient_is_that_of_finite_differences(by, dtype, small, bound, recorded):
    misfit, way = compare(recorded), change(2)

    def value(factor):
        host = medium(dtype, by=(by, factor * small * way))
        traces = simulate_emissions(host, EMISSIONS, engine="opencl")
        return sum(misfit(k, one)[0] for k, one in enumerate(traces))

    found = sum((one.gradient * way).sum() for one in gradients(medium(dtype), misfit, "opencl", by=by))
    near, far = ((value(k) - value(-k)) / (2.0 * k * small) for k in (1, 2))
    assert found == pytest.approx((4.0 * near - far) / 3.0, rel=bound)


@pytest.mark.opencl
@pytest.mark.parametrize(("dtype", "bound"), [(np.float64, 1e-11), (np.float32, 1e-4)])
def test_scattering_and_the_gradient_are_transposes(dtype, bound):
    # The gradient of <traces, residual> is the adjoint applied to the residual; Born modelling with compiled
    # code in float64, by finite differences of the fourth order.
    rng = np.random.default_rng(3)
    residual = [rng.standard_normal((len(valid), STEPS)) for valid in VALID]
    way, small = change(4), 0.1

    def correlated(k, traces):
        return float((traces * residual[k]).sum()), residual[k]

    def traces(factor):
        return list(simulate_emissions(medium(np.float64, by=("speed", factor * small * way)), EMISSIONS))

    runs = {factor: traces(factor) for factor in (-2, -1, 1, 2)}
    found = gradients(medium(dtype), correlated, "opencl")
    for k, one in enumerate(found):
        born = (8.0 * (runs[1][k] - runs[-1][k]) - (runs[2][k] - runs[-2][k])) / (12.0 * small)
        size = np.linalg.norm(born) * np.linalg.norm(residual[k])
        assert abs((born * residual[k]).sum() - (one.gradient * way).sum()) < max(bound, 1e-8) * size


@pytest.mark.opencl
def test_every_run_and_every_tile_gives_the_same_bits(recorded):
    misfit = compare(recorded)
    runs = [gradients(medium(), misfit, "opencl", 3) for _ in range(2)]
    session = session_or_warning("")
    waves = DeviceWaves(session, medium(), Scan(place_elements(medium(), RECEIVERS), STEPS, 3))
    alone = gradients(medium(), misfit, "opencl", 3, memory_bytes=1.5 * waves.emitter_bytes[0])
    for first, *others in zip(*runs, alone, strict=True):
        for other in others:
            assert first.misfit == other.misfit
            assert np.array_equal(first.gradient, other.gradient)
            assert np.array_equal(first.illumination, other.illumination)


@pytest.mark.opencl
@pytest.mark.parametrize("by", ["speed", "attenuation"])
def test_groups_of_a_processor_and_of_a_gpu_give_the_same_bits(by):
    session, host = session_or_warning(""), medium()
    scan = Scan(place_elements(host, RECEIVERS), STEPS, 3, by)
    sources = place_elements(host, EMITTERS)
    found = []
    for group, tile in itertools.product((PROCESSOR_GROUP, OTHER_GROUP), (slice(0, 5), slice(0, 2))):
        waves = DeviceWaves(session, host, scan, group)
        some = Points(sources.first[tile], sources.weights[tile])
        traces, stored = waves.forward(some, WAVELET / np.abs(WAVELET).max(), no_poll)
        found.append((traces, *waves.backward(traces, stored, no_poll)))
    for others in found[1:]:
        for expected, other in zip(found[0], others, strict=True):
            assert other.any()
            assert np.array_equal(expected[: len(other)], other[: len(expected)])


@pytest.mark.opencl
def test_tiles_hold_every_emitter_once_within_the_memory():
    session, host = session_or_warning(""), medium()
    waves = DeviceWaves(session, host, Scan(place_elements(host, RECEIVERS), STEPS, 1))
    whole, largest = waves.emitter_bytes
    assert 0 < largest < whole
    for memory in (math.inf, 2.5 * whole, whole):
        tiles = list(waves.tiles(7, memory))
        assert [k for tile in tiles for k in range(7)[tile]] == list(range(7))
        assert all((tile.stop - tile.start) * whole <= memory for tile in tiles)
    with pytest.raises(InvalidInput, match=f"{whole} bytes"):
        waves.tiles(7, whole - 1)


@pytest.mark.opencl
def test_a_poll_ends_it_between_blocks():
    calls = []

    def poll():
        calls.append(1)
        if len(calls) == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        list(simulate_emissions(medium(), EMISSIONS, poll, "opencl"))
    assert len(calls) == 3


def test_without_a_device_compiled_code_computes_with_a_warning(monkeypatch, recorded):
    monkeypatch.setattr(choice, "find_devices", list)
    choice._found.cache_clear()
    choice._warn_once.cache_clear()
    misfit = compare(recorded)
    try:
        with pytest.warns(OpenCLFallbackWarning, match="compiled code"):
            found = gradients(medium(), misfit, "opencl")
    finally:
        choice._found.cache_clear()
        choice._warn_once.cache_clear()
    for one, other in zip(found, gradients(medium(), misfit, "compiled"), strict=True):
        assert np.array_equal(one.gradient, other.gradient)


@pytest.mark.parametrize("engine", ENGINES)
def test_bad_input_is_rejected_by_both_engines(engine):
    with pytest.raises(InvalidInput, match="element_position_m"):
        list(simulate_emissions(medium(), EMISSIONS._replace(receivers=RECEIVERS + 1.0), engine=engine))
    with pytest.raises(InvalidInput, match="every"):
        gradients(medium(), None, engine, 0)
    space = Medium.of(np.full((6, 6, 6), 1500.0), 1e-3, 1e-7, edge_nodes=4)
    with pytest.raises(InvalidInput, match="speed"):
        list(simulate_emissions(space, EMISSIONS, engine=engine))

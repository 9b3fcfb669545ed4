"""Many emissions on OpenCL: traces and gradients of compiled code, whatever is in flight together; memory."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.opencl import OpenCLFallbackWarning, device_selection, session_or_warning
from bentray_kernels.tomography.waveform import misfits
from bentray_kernels.wave.device_memory import ShotPlan, ShotSize
from bentray_kernels.wave.device_shots import ShotBatch
from bentray_kernels.wave.device_waves import OTHER_GROUP, PROCESSOR_GROUPS, DeviceWaves, Scan, tiles
from bentray_kernels.wave.emissions import Observed, emission_misfits, misfit_gradients, simulate_emissions
from bentray_kernels.wave.points import Points
from bentray_kernels.wave.simulation import place_elements, simulate
from bentray_kernels.wave.time_blocks import no_poll

from .emissions_scan import (
    EMISSIONS,
    EMITTERS,
    PLANE,
    RECEIVERS,
    SPACE,
    STEPS,
    VALID,
    WAVELET,
    change,
    compare,
    medium,
    slope,
    windows,
)

ENGINES = ("compiled", "opencl")


def gradients(host, misfit, engine, every=1, by="speed", **options):
    return list(misfit_gradients(host, EMISSIONS, misfit, every, by, engine=engine, **options))


def energy(_, traces):
    return 0.5 * float((traces**2).sum()), traces


def off(computed, expected):
    return np.abs(computed - expected).max() / np.abs(expected).max()


@pytest.fixture(scope="module")
def recorded():
    return list(simulate_emissions(medium(seed=5), EMISSIONS))


@pytest.mark.opencl
@pytest.mark.parametrize("case", [PLANE, SPACE], ids=["2d", "3d"])
@pytest.mark.parametrize(("dtype", "bound"), [(np.float64, 1e-12), (np.float32, 1e-5)])
def test_traces_are_those_of_the_compiled_engine(dtype, bound, case):
    host, emissions = case.medium(dtype), case.emissions
    computed = list(simulate_emissions(host, emissions, engine="opencl"))
    assert len(computed) == len(emissions.emitters)
    for traces, expected in zip(computed, simulate_emissions(host, emissions), strict=True):
        assert traces.dtype == dtype
        assert traces.shape == expected.shape
        assert off(traces, expected) < bound


@pytest.mark.parametrize("case", [PLANE, SPACE], ids=["2d", "3d"])
def test_compiled_engine_gives_the_traces_of_single_emissions(case):
    host, (emitters, receivers, valid, wavelet) = case.medium(), case.emissions[:4]
    for k, traces in enumerate(simulate_emissions(host, case.emissions)):
        assert np.array_equal(traces, simulate(host, emitters[k], receivers[valid[k]], wavelet))


def test_compiled_code_has_no_gradient_in_3d():
    with pytest.raises(InvalidInput, match="speed"):
        list(misfit_gradients(SPACE.medium(), SPACE.emissions, energy))


@pytest.mark.opencl
@pytest.mark.parametrize("by", ["speed", "attenuation"])
@pytest.mark.parametrize(("dtype", "every", "bound"), [(np.float64, 1, 1e-11), (np.float32, 4, 1e-4)])
def test_gradients_are_those_of_the_compiled_engine(by, dtype, every, bound, recorded):
    host, misfit = medium(dtype), compare(recorded)
    both = [gradients(host, misfit, engine, every, by) for engine in ENGINES]
    for expected, computed in zip(*both, strict=True):
        assert computed.misfit == pytest.approx(expected.misfit, rel=bound)
        assert off(computed.gradient, expected.gradient) < bound
        assert off(computed.illumination, expected.illumination) < bound


@pytest.mark.opencl
@pytest.mark.parametrize("by", ["speed", "attenuation"])
@pytest.mark.parametrize(("dtype", "small", "bound"), [(np.float64, 3e-2, 1e-6), (np.float32, 3.0, 1e-2)])
def test_gradient_is_that_of_finite_differences(by, dtype, small, bound, recorded):
    misfit, way = compare(recorded), change(2)

    def value(factor):
        traces = simulate_emissions(medium(dtype, by=(by, factor * way)), EMISSIONS, engine="opencl")
        return sum(misfit(k, trace)[0] for k, trace in enumerate(traces))

    result = sum((shot.gradient * way).sum() for shot in gradients(medium(dtype), misfit, "opencl", by=by))
    assert result == pytest.approx(slope(value, small), rel=bound)


@pytest.mark.opencl
@pytest.mark.parametrize("by", ["speed", "attenuation"])
def test_gradient_in_space_is_that_of_finite_differences(by):
    way = change(2, SPACE.shape)

    def value(factor):
        host = SPACE.medium(np.float64, by=(by, factor * way))
        return sum(
            energy(0, trace)[0] for trace in simulate_emissions(host, SPACE.emissions, engine="opencl")
        )

    parts, cheap = (
        list(misfit_gradients(SPACE.medium(dtype), SPACE.emissions, energy, by=by, engine="opencl"))
        for dtype in (np.float64, np.float32)
    )
    assert sum((part.gradient * way).sum() for part in parts) == pytest.approx(slope(value, 0.1), rel=1e-6)
    for first, other in zip(cheap, parts, strict=True):
        assert off(first.gradient, other.gradient) < 1e-4


@pytest.mark.opencl
@pytest.mark.parametrize(("dtype", "bound"), [(np.float64, 1e-11), (np.float32, 1e-4)])
def test_scattering_and_the_gradient_are_transposes(dtype, bound):
    # The gradient of <traces, residual> is the adjoint applied to the residual; Born modelling with compiled
    # code in float64, by finite differences of the fourth order.
    rng = np.random.default_rng(3)
    residual = [rng.standard_normal((len(valid), STEPS)) for valid in VALID]
    way = change(4)

    def correlated(k, traces):
        return float((traces * residual[k]).sum()), residual[k]

    for k, shot in enumerate(gradients(medium(dtype), correlated, "opencl")):

        def traces(factor, k=k):
            host = medium(np.float64, by=("speed", factor * way))
            return simulate(host, EMITTERS[k], RECEIVERS[VALID[k]], WAVELET)

        born = slope(traces, 0.1)
        size = np.linalg.norm(born) * np.linalg.norm(residual[k])
        assert abs((born * residual[k]).sum() - (shot.gradient * way).sum()) < max(bound, 1e-8) * size


@pytest.mark.opencl
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("measure", [misfits.correlation, misfits.least_squares])
def test_misfits_on_the_device_are_those_of_the_host(measure, dtype, recorded):
    bound = 1e-11 if dtype == np.float64 else 1e-4
    traces = [trace.astype(np.float64) for trace in recorded]
    # A dead trace.
    traces[1][2] = 0.0
    weights = [windows(k) for k in range(len(VALID))]

    def here(k, simulated):
        return measure(simulated, traces[k], weights[k])

    def there(k):
        result = np.zeros((2, STEPS, len(RECEIVERS)), dtype)
        result[0][:, VALID[k]], result[1][:, VALID[k]] = traces[k].T, weights[k].T
        return result[0], result[1]

    host, observed = medium(dtype), Observed(measure.__name__, there)
    expected = gradients(host, here, "opencl")
    computed = gradients(host, here, "opencl", observed=observed)
    values = list(emission_misfits(host, EMISSIONS, here, engine="opencl", observed=observed))
    for first, other, value in zip(computed, expected, values, strict=True):
        assert first.misfit == value == pytest.approx(other.misfit, rel=bound)
        assert off(first.gradient, other.gradient) < bound
        assert np.array_equal(first.illumination, other.illumination)


@pytest.mark.opencl
def test_every_run_every_tile_and_every_checkpoint_give_the_same_bits(recorded):
    misfit = compare(recorded)
    waves = DeviceWaves(session_or_warning(""), medium(), Scan(place_elements(medium(), RECEIVERS), STEPS, 1))
    limits = [math.inf, math.inf, *(1.001 * waves.size.bytes(segments) for segments in (1, 2, 5))]
    assert [waves.plan(limit).segments for limit in limits] == [1, 1, 1, 2, 5]
    assert waves.plan(limits[2]).emitters == 1
    runs = [gradients(medium(), misfit, "opencl", 1, memory_bytes=limit) for limit in limits]
    for first, *others in zip(*runs, strict=True):
        assert first.gradient.any()
        for other in others:
            assert first.misfit == other.misfit
            assert np.array_equal(first.gradient, other.gradient)
            assert np.array_equal(first.illumination, other.illumination)


def simulated(host, scan, sources, wavelet, group=None, segments=1):
    """Traces of a batch, and its gradient and illumination with the traces as the residuals."""
    waves = DeviceWaves(session_or_warning(""), host, scan, group)
    batch = ShotBatch(waves, sources, wavelet / np.abs(wavelet).max(), segments, no_poll)
    batch.forward()
    return batch.traces(), *batch.backward()


@pytest.mark.opencl
@pytest.mark.parametrize(
    ("case", "by", "every", "segments", "group"),
    [
        *((PLANE, "attenuation", every, n, None) for every in (1, 3, 7) for n in (2, 3, 10)),
        *((SPACE, "speed", 3, n, OTHER_GROUP) for n in (2, 5)),
    ],
)
def test_divided_time_loops_give_the_bits_of_whole_ones(case, by, every, segments, group):
    host, (emitters, receivers, _, wavelet) = case.medium(), case.emissions[:4]
    scan = Scan(place_elements(host, receivers), wavelet.size, every, by)
    sources = place_elements(host, emitters[:2])
    whole = simulated(host, scan, sources, wavelet)
    for one, divided in zip(whole, simulated(host, scan, sources, wavelet, group, segments), strict=True):
        assert one.any()
        assert np.array_equal(one, divided)


@pytest.mark.opencl
@pytest.mark.parametrize("by", ["speed", "attenuation"])
def test_groups_of_a_processor_and_of_a_gpu_give_the_same_bits(by):
    host = medium()
    scan, sources = Scan(place_elements(host, RECEIVERS), STEPS, 3, by), place_elements(host, EMITTERS)
    computed = [
        simulated(host, scan, Points(sources.first[tile], sources.weights[tile]), WAVELET, group)
        for group, tile in itertools.product((PROCESSOR_GROUPS[0], OTHER_GROUP), (slice(0, 5), slice(0, 2)))
    ]
    for others in computed[1:]:
        for expected, other in zip(computed[0], others, strict=True):
            assert other.any()
            assert np.array_equal(expected[: len(other)], other[: len(expected)])


def test_tiles_hold_every_emitter_once():
    for emitters, most in ((0, 3), (1, 3), (7, 3), (7, 7), (7, 10)):
        listed = list(tiles(emitters, most))
        assert [k for tile in listed for k in range(emitters)[tile]] == list(range(emitters))
        sizes = [tile.stop - tile.start for tile in listed]
        assert not sizes or max(sizes) <= min(most, min(sizes) + 1)


@pytest.mark.opencl
def test_a_device_that_is_too_small_is_refused_by_number():
    host = medium()
    waves = DeviceWaves(session_or_warning(""), host, Scan(place_elements(host, RECEIVERS), STEPS, 1))
    least = min(waves.size.bytes(segments) for segments in range(1, STEPS + 1))
    with pytest.raises(InvalidInput, match=f"{least} bytes"):
        waves.plan(least - 1)
    assert waves.plan(least).emitters == 1


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
    monkeypatch.setattr(device_selection, "find_devices", list)
    device_selection._found.cache_clear()
    device_selection._warn_once.cache_clear()
    misfit = compare(recorded)
    try:
        with pytest.warns(OpenCLFallbackWarning, match="compiled code"):
            result = gradients(medium(), misfit, "opencl")
    finally:
        device_selection._found.cache_clear()
        device_selection._warn_once.cache_clear()
    for first, other in zip(result, gradients(medium(), misfit, "compiled"), strict=True):
        assert np.array_equal(first.gradient, other.gradient)


@pytest.mark.parametrize("engine", ENGINES)
def test_bad_input_is_rejected_by_both_engines(engine):
    with pytest.raises(InvalidInput, match="element_position_m"):
        list(simulate_emissions(medium(), EMISSIONS._replace(receivers=RECEIVERS + 1.0), engine=engine))
    with pytest.raises(InvalidInput, match="every"):
        gradients(medium(), None, engine, 0)


SIZES = st.builds(
    ShotSize,
    st.integers(1, 10**6),
    st.integers(1, 10**6),
    st.integers(0, 300),
    st.integers(0, 10**6),
    st.sampled_from([4, 8]),
)


@given(SIZES, st.integers(1, 10**9), st.integers(1, 10**9))
def test_a_plan_fits_or_there_is_none(size, limit, array):
    fitting = [
        segments
        for segments in range(1, max(1, size.slots) + 1)
        if size.bytes(segments) <= limit and size.largest_bytes(segments) <= array
    ]
    if not fitting:
        with pytest.raises(InvalidInput, match=f"at most {limit} bytes, {array} in one array"):
            ShotPlan.for_memory(size, limit, array)
        return
    plan = ShotPlan.for_memory(size, limit, array)
    assert plan.segments == fitting[0]
    assert plan.emitters >= 1
    assert plan.emitters * size.bytes(plan.segments) <= limit
    assert plan.emitters * size.largest_bytes(plan.segments) <= array


def test_a_volume_takes_checkpoints_of_a_few_dozen_fields():
    # 256 nodes a side with edges, 1000 steps, every fourth field: 250 stored ones would take 17 GB.
    size = ShotSize(304**3, 256**3, 250, 1000 * 256, 4)
    assert size.bytes(1) > 17e9
    plan = ShotPlan.for_memory(size, 6e9, math.inf)
    assert plan.emitters == 1
    assert 3 < plan.segments < 8
    assert size.bytes(plan.segments) < 6e9

"""Preparation: wavelet and water from water shots, choice of emitters, gains, source, rejected input."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition.emissions import Emissions
from bentray_kernels.acquisition.simulation.phantom_truth import Truth
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography.waveform.band_inversion import Model, evaluate
from bentray_kernels.tomography.waveform.preparation import prepare
from bentray_kernels.tomography.waveform.refinement_graph import start_band, starting_models
from bentray_kernels.tomography.waveform.source_estimation import estimate_source
from bentray_kernels.tomography.waveform.waveform_settings import Band, WaveSettings
from bentray_kernels.wave.simulation import simulate

from .scans import SPACING, scan, true_image

SETTINGS = WaveSettings(
    (Band(8e4, 2.5e5, 1.3e-3, emitters=6), Band(8e4, 2.5e5, 1.5e-3, emitters=6)), nearest_m=0.012, held_out=3
)


def test_water_shots_are_simulated_as_recorded():
    problem = prepare(scan(), SETTINGS, 0)
    assert problem.water_correlation > 0.99
    assert abs(problem.water.lead) < 1.5e-3
    emitter = int(problem.held[0])
    heard = problem.valid_receivers(emitter)
    medium = problem.medium(np.full(problem.region.shape, 1500.0))
    traces = simulate(medium, problem.emitters[emitter], problem.receivers[heard], problem.wavelet)
    recorded = scan().waveform.water[emitter][heard] @ problem.sampler
    # Size as well as shape.
    assert np.sqrt(((traces - recorded) ** 2).sum() / (recorded**2).sum()) < 0.15


def test_a_wrong_speed_of_water_is_found():
    wrong = replace(scan(), water_speed_mps=1503.0)
    problem = prepare(wrong, SETTINGS, 0)
    assert 1503.0 / (1.0 - problem.water.lead) == pytest.approx(1500.0, abs=2.0)


def test_held_out_emitters_are_the_same_in_every_band_and_not_used():
    first, second = (prepare(scan(), SETTINGS, number) for number in (0, 1))
    assert np.array_equal(first.held, second.held)
    assert not np.array_equal(first.used, second.used)
    for problem in (first, second):
        assert problem.used.size == 6
        assert not set(problem.used) & set(problem.held)


def test_the_draw_hangs_on_the_seed_alone():
    again = prepare(scan(), SETTINGS, 0)
    assert np.array_equal(again.used, prepare(scan(), SETTINGS, 0).used)
    others = [prepare(scan(), replace(SETTINGS, seed=k), 0).used for k in range(1, 4)]
    assert any(not np.array_equal(again.used, other) for other in others)


def test_dead_traces_and_near_pairs_are_left_out():
    data = scan()
    traces = data.waveform.object.copy()
    traces[3, 7] = 0.0
    problem = prepare(replace(data, waveform=replace(data.waveform, object=traces)), SETTINGS, 0)
    assert 7 not in problem.valid_receivers(3)
    distance = data.distance_m()
    assert not (problem.weight * (distance < 0.012)).any()


def test_no_other_emissions_are_read_than_the_band_uses():
    data, read = scan(), []

    def lazily(traces):
        def one(emitter):
            read.append(emitter)
            return traces[emitter]

        return Emissions.from_reader(one, traces.shape, traces.dtype)

    recorded = data.waveform
    apart = replace(recorded, object=lazily(recorded.object), water=lazily(recorded.water))
    settings = replace(SETTINGS, bands=(replace(SETTINGS.bands[0], emitters=3),), held_out=2)
    computed, expected = (prepare(replace(data, waveform=wave), settings, 0) for wave in (apart, recorded))
    drawn = {*computed.used.tolist(), *computed.held.tolist()}
    assert set(read) == set(computed.traces) == drawn
    assert len(drawn) == 5
    assert np.array_equal(computed.wavelet, expected.wavelet)
    assert np.array_equal(
        computed.recorded(int(computed.held[0]), np.arange(24)), expected.recorded(0, np.arange(24))
    )
    # What is kept is no part of a block of emissions.
    assert all(traces.base is None for traces in computed.traces.values())


def test_dead_emitters_are_not_used():
    data = scan()
    whole = prepare(data, SETTINGS, 0)
    dead = [int(whole.used[1]), int(whole.held[2])]
    traces = data.waveform.object.copy()
    traces[dead] = 0.0
    result = prepare(replace(data, waveform=replace(data.waveform, object=traces)), SETTINGS, 0)
    assert sorted({*whole.used, *whole.held} - {*result.used, *result.held}) == sorted(dead)
    silent = replace(data, waveform=replace(data.waveform, water=np.zeros_like(traces)))
    with pytest.raises(InvalidInput, match="waveform/object, waveform/water: found zeros alone"):
        prepare(silent, SETTINGS, 0)


def test_gains_of_traces_are_used():
    data = scan()
    rng = np.random.default_rng(0)
    gains = rng.uniform(0.5, 2.0, (2, *data.waveform.object.shape[:2]))
    waveform = replace(
        data.waveform,
        object=(data.waveform.object / gains[0][:, :, None]).astype(np.float32),
        water=(data.waveform.water / gains[1][:, :, None]).astype(np.float32),
        object_scale=gains[0],
        water_scale=gains[1],
    )
    plain, scaled = (prepare(replace(data, waveform=w), SETTINGS, 0) for w in (data.waveform, waveform))
    assert np.allclose(scaled.wavelet, plain.wavelet, atol=1e-4 * np.abs(plain.wavelet).max())
    heard = plain.valid_receivers(1)
    expected = plain.recorded(1, heard)
    assert np.allclose(scaled.recorded(1, heard), expected, atol=1e-5 * np.abs(expected).max())


def test_only_the_region_of_interest_may_change():
    roi = np.zeros((50, 50), dtype=np.bool_)
    roi[20:30, 10:40] = True
    truth = Truth(np.full((50, 50), 1500.0), (1e-3, 1e-3), (-0.0245, -0.0245))
    problem = prepare(replace(scan(), roi=roi, truth=truth), replace(SETTINGS, roi=True), 0)
    x, y = (
        problem.origin[axis] + problem.band.spacing_m * np.flatnonzero(problem.region.any(axis=1 - axis))
        for axis in (0, 1)
    )
    assert np.abs(x).max() < 0.006
    assert np.abs(y).max() > 0.010
    with pytest.raises(InvalidInput, match="mask/roi"):
        prepare(scan(), replace(SETTINGS, roi=True), 0)


@pytest.mark.parametrize("lacking", ["water", "all"])
def test_a_scan_without_water_shots_is_rejected(lacking):
    data = scan()
    waveform = replace(data.waveform, water=None) if lacking == "water" else None
    tof = None if lacking == "water" else np.ones(data.waveform.object.shape[:2])
    with pytest.raises(InvalidInput, match="waveform/water"):
        prepare(replace(data, waveform=waveform, tof_s=tof), SETTINGS, 0)


def test_emitters_must_be_left_to_make_the_image():
    with pytest.raises(InvalidInput, match="held_out"):
        prepare(scan(), replace(SETTINGS, held_out=12), 0)


ONE_BAND = WaveSettings((Band(8e4, 2.5e5, 1.3e-3, emitters=6),), nearest_m=0.012, held_out=3)


@pytest.fixture(scope="module")
def truth():
    return true_image(SPACING, 56)


@pytest.fixture(scope="module")
def spoiled():
    """The problem with another source: a quarter of a period later, and three times as strong."""
    problem = prepare(scan(), ONE_BAND, 0)
    steps = round(1e-6 / problem.clock.step_s)
    gain = np.linspace(0.5, 2.0, problem.gain.size).reshape(problem.gain.shape)
    later = 3.0 * np.roll(problem.wavelet, steps)
    return problem, replace(problem, wavelet=later, gain=problem.gain * gain)


def held(problem, speed, wavelet=None):
    return evaluate(problem, ONE_BAND, Model(speed, None, wavelet), problem.held).held / problem.held.size


def test_a_wrong_source_is_replaced_whatever_the_gains(truth, spoiled):
    right, wrong = spoiled
    speed = starting_models(truth, right, ONE_BAND)[0].speed
    best = held(right, speed)
    assert held(wrong, speed) > best + 0.3
    assert held(wrong, speed, estimate_source(wrong, speed, ONE_BAND.window_s)) < best + 0.01


def test_a_band_begins_with_it_where_the_settings_say_so(truth, spoiled):
    settings = replace(ONE_BAND, estimates_source=True)

    class Scan:
        plan = settings

        def problem(self, number):
            return spoiled[1]

    band = start_band(Scan(), 0, truth)
    speed = band.state.image
    assert any(np.array_equal(speed, model.speed) for model in starting_models(truth, spoiled[1], settings))
    expected = estimate_source(spoiled[1], speed, settings.window_s)
    np.testing.assert_array_equal(band.model.wavelet, expected)
    assert band.model.attenuation is None


def test_gains_of_traces_and_their_scale_change_no_source(truth, spoiled):
    right, _ = spoiled
    speed = starting_models(truth, right, ONE_BAND)[0].speed
    gain = 1e-4 * right.gain * np.random.default_rng(0).uniform(0.2, 5.0, right.gain.shape)
    estimated, scaled = (
        estimate_source(problem, speed, ONE_BAND.window_s) for problem in (right, replace(right, gain=gain))
    )
    np.testing.assert_allclose(scaled, estimated, atol=1e-4 * np.abs(estimated).max())

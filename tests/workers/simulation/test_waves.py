"""2-D wave simulation: arrivals, reciprocity, noise, dispersion, rejected settings."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from bentray_kernels.acquisition import pick
from bentray_workers.simulation.simulation_run import simulate
from bentray_workers.simulation.waves import HIGHEST, Noise, VerticalWaveSettings, WaveSimulationSettings

SMALL = WaveSimulationSettings(frequency_hz=3e5, side_m=0.05, elements=24, emissions=6, nodes=32)


@pytest.fixture(scope="module")
def scan():
    return simulate(SMALL)


def test_the_pulse_in_water_comes_when_it_should(scan):
    """In a plane a pulse is turned by an eighth of a period and dragged out; so times are held against it."""
    water = scan.waveform.water
    far = scan.distance_m()[0] > 0.02
    at = scan.t0_s + np.abs(water[0]).argmax(axis=-1)[far] / scan.sampling_rate_hz
    late = at - scan.distance_m()[0][far] / scan.water_speed_mps
    # Alike for all distances, to a sample and what the phase speed is wrong by.
    assert np.ptp(late) <= 1.5 / scan.sampling_rate_hz
    assert abs(late.mean()) < 1.0 / SMALL.frequency_hz


def test_traces_are_reciprocal(scan):
    for name in ("object", "water"):
        traces = getattr(scan.waveform, name)
        there, back = traces[0, scan.tx[2]], traces[2, scan.tx[0]]
        assert np.abs(there - back).max() < 2e-3 * np.abs(there).max()


def test_the_object_is_picked_slower_than_water_through_fat(scan):
    """Two thirds of the way are fat or tissue, which both are slower than the water."""
    delta = pick(scan).delta_tof_s
    across = delta[0, np.argsort(scan.distance_m()[0])[-5:]]
    assert (across[np.isfinite(across)] > 1e-7).all()
    assert np.isfinite(across).any()


def test_the_vertical_slice_has_water_above_the_chest(scan):
    upright = VerticalWaveSettings(**asdict(SMALL))
    traces = simulate(upright)
    assert traces.title.startswith("2-D breast phantom (Li 2008, Table 6), vertical slice, 50 mm")
    np.testing.assert_array_equal(traces.waveform.water, scan.waveform.water)
    assert (traces.truth.sound_speed_mps[:, -8:] == SMALL.coupling_mps).all()
    # From an element at the top to the next one the direct wave does not pass the object.
    at = traces.element_position_m
    top = np.argsort(at[traces.tx][:, 1])[-1]
    beside = np.argsort(np.linalg.norm(at - at[traces.tx[top]], axis=1))[1]
    first, water = traces.waveform.object[top, beside], traces.waveform.water[top, beside]
    peak = np.abs(water).argmax() + 1
    assert np.abs(first[:peak] - water[:peak]).max() < 5e-3 * np.abs(water).max()
    assert np.abs(first - water).max() > 1e-2 * np.abs(water).max()


def test_noise_has_the_requested_size(scan):
    noisy = simulate(replace(SMALL, snr=20.0))
    added = noisy.waveform.water - scan.waveform.water
    expected = np.median(np.abs(scan.waveform.water).max(axis=-1)) / 20.0
    assert added.std() == pytest.approx(expected, rel=0.02)
    assert not np.array_equal(added, noisy.waveform.object - scan.waveform.object)
    again = Noise(replace(SMALL, snr=20.0), np.abs(scan.waveform.water).max(axis=-1))
    assert np.array_equal(scan.waveform.object[0] + again.drawn(), noisy.waveform.object[0])


def test_the_dispersion_is_within_its_budget():
    for frequency in (1e5, 5e5, 2e6):
        settings = WaveSimulationSettings(frequency_hz=frequency)
        centre, highest = settings.dispersion
        assert abs(centre) < 1e-3
        assert abs(highest) < 3e-3
        assert settings.speeds[0] / (HIGHEST * frequency) > 6.5 * settings.spacing_m

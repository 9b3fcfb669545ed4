"""Re-estimation of the source from traces of the object."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.tomography.waveform.band_inversion import Model, evaluate
from bentray_kernels.tomography.waveform.inversion_state import Image
from bentray_kernels.tomography.waveform.preparation import prepare
from bentray_kernels.tomography.waveform.refinement_graph import start_band, starting_models
from bentray_kernels.tomography.waveform.source_estimation import estimate_source
from bentray_kernels.tomography.waveform.waveform_settings import Band, WaveSettings

from .scans import SPACING, blob, scan

SETTINGS = WaveSettings((Band(8e4, 2.5e5, 1.3e-3, emitters=6),), nearest_m=0.012, held_out=3)


@pytest.fixture(scope="module")
def truth():
    axis = SPACING * np.arange(-56, 57)
    return Image(blob(*np.meshgrid(axis, axis, indexing="ij")), SPACING, (axis[0], axis[0]))


@pytest.fixture(scope="module")
def spoiled():
    """The problem with another source: a quarter of a period later, and three times as strong."""
    problem = prepare(scan(), SETTINGS, 0)
    steps = round(1e-6 / problem.clock.step_s)
    gain = np.linspace(0.5, 2.0, problem.gain.size).reshape(problem.gain.shape)
    later = 3.0 * np.roll(problem.wavelet, steps)
    return problem, replace(problem, wavelet=later, gain=problem.gain * gain)


def held(problem, speed, wavelet=None):
    return evaluate(problem, SETTINGS, Model(speed, None, wavelet), problem.held).held / problem.held.size


def test_a_wrong_source_is_replaced_whatever_the_gains(truth, spoiled):
    right, wrong = spoiled
    speed = starting_models(truth, right, SETTINGS)[0].speed
    best = held(right, speed)
    assert held(wrong, speed) > best + 0.3
    assert held(wrong, speed, estimate_source(wrong, speed, SETTINGS.window_s)) < best + 0.01


def test_a_band_begins_with_it_where_the_settings_say_so(truth, spoiled):
    settings = replace(SETTINGS, estimates_source=True)

    class Scan:
        def settings(self):
            return settings

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
    speed = starting_models(truth, right, SETTINGS)[0].speed
    gain = 1e-4 * right.gain * np.random.default_rng(0).uniform(0.2, 5.0, right.gain.shape)
    estimated, scaled = (
        estimate_source(problem, speed, SETTINGS.window_s) for problem in (right, replace(right, gain=gain))
    )
    np.testing.assert_allclose(scaled, estimated, atol=1e-4 * np.abs(estimated).max())

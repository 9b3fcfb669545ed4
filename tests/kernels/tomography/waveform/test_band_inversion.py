"""One step of a refinement, from looks that were made up: shortening, the guard, the end, records."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.tomography.waveform.band_inversion import (
    MAX_BACKTRACKS,
    PATIENCE,
    EmitterMisfit,
    Evaluation,
    begin,
    given_by,
    step,
)
from bentray_kernels.tomography.waveform.inversion_state import BandEnd, Image
from bentray_kernels.tomography.waveform.iterations import iteration_records, shift_s
from bentray_kernels.tomography.waveform.preparation import prepare
from bentray_kernels.tomography.waveform.waveform_settings import Band, WaveSettings

from .scans import WATER, scan

SETTINGS = WaveSettings((Band(8e4, 1.7e5, 2e-3, iterations=6, emitters=6),), nearest_m=0.012, held_out=2)


@pytest.fixture(scope="module")
def problem():
    return prepare(scan(), SETTINGS, 0)


def told(problem, misfit, held, seed=0):
    """A look of all emitters with a mean misfit and some gradient."""
    shape = problem.region.shape
    return [
        EmitterMisfit(
            misfit * problem.used.size, held * problem.held.size, change(seed, shape), np.ones(shape)
        )
    ]


def first(problem):
    state = begin(np.full(problem.region.shape, WATER))
    return step(problem, SETTINGS, state, told(problem, 1.0, 1.0))


def test_the_first_step_has_the_set_size_and_reduces_the_misfit(problem):
    state = first(problem)
    way = state.image - WATER
    assert np.sqrt((way[problem.region] ** 2).mean()) == pytest.approx(SETTINGS.steps("speed").first)
    assert (way * state.gradient).sum() < 0.0
    assert not way[~problem.region].any()


def test_step_that_increases_the_misfit_is_shortened_then_rejected(problem):
    state = first(problem)
    sizes = [np.abs(state.step).max()]
    while not state.done:
        state = step(problem, SETTINGS, state, told(problem, 2.0, 1.0))
        sizes.append(np.abs(state.step).max())
    assert len(state.history) == 2 + MAX_BACKTRACKS
    assert all(later < earlier for earlier, later in pairwise(sizes[:-1]))
    assert (state.image == WATER).all()
    assert not state.skipped


def test_it_stops_when_the_held_out_misfit_rises(problem):
    state = step(problem, SETTINGS, first(problem), told(problem, 0.9, 0.9, 1))
    liked = state.accepted_image
    for k in range(PATIENCE):
        assert not state.done
        state = step(problem, SETTINGS, state, told(problem, 0.8 - 0.1 * k, 1.5, 2 + k))
    assert state.done
    assert state.skipped
    assert np.array_equal(state.image, liked)


def test_of_the_attenuation_held_out_emitters_choose_the_image():
    band = replace(SETTINGS.bands[0], iterations=2, of="attenuation")
    plan = replace(SETTINGS, bands=(band,))
    problem = prepare(scan(), plan, 0)
    state = begin(np.zeros(problem.region.shape))
    liked = None
    for k, held in enumerate((1.0, 0.9, 0.95)):
        liked = state.image if held == 0.9 else liked
        state = step(problem, plan, state, told(problem, 1.0 - 0.1 * k, held, k))
    assert state.done
    assert not state.skipped
    assert np.array_equal(state.image, liked)
    assert liked.min() >= 0.0
    assert given_by(state.history, by_held_out=True) == 1
    assert given_by(state.history, by_held_out=False) == 2


def test_without_held_out_emitters_the_last_image_counts():
    band = replace(SETTINGS.bands[0], iterations=1, of="attenuation")
    plan = replace(SETTINGS, bands=(band,), held_out=0)
    problem = prepare(scan(), plan, 0)
    state = begin(np.zeros(problem.region.shape))
    for k in range(2):
        last = state.image
        shape = problem.region.shape
        look = EmitterMisfit((1.0 - 0.1 * k) * problem.used.size, 0.0, change(k, shape), np.ones(shape))
        state = step(problem, plan, state, [look])
    assert np.array_equal(state.image, last)
    assert given_by(state.history, by_held_out=True) == 1


def change(seed, shape):
    return np.random.default_rng(seed).standard_normal(shape) * 1e-4


def test_one_rise_alone_does_not_stop_it(problem):
    state = step(problem, SETTINGS, first(problem), told(problem, 0.9, 1.5, 1))
    state = step(problem, SETTINGS, state, told(problem, 0.8, 0.9, 2))
    state = step(problem, SETTINGS, state, told(problem, 0.7, 1.5, 3))
    assert not state.done


def test_it_ends_after_its_iterations(problem):
    state = first(problem)
    for k in range(SETTINGS.bands[0].iterations):
        assert not state.done
        state = step(problem, SETTINGS, state, told(problem, 0.9 - 0.1 * k, 0.9, k + 1))
    assert state.done
    assert np.array_equal(state.image, state.accepted_image)


def test_bounds_hold(problem):
    tight = WaveSettings(SETTINGS.bands, nearest_m=0.012, held_out=2, speed_bounds_mps=(1499.5, 1500.5))
    state = begin(np.full(problem.region.shape, WATER))
    state = step(problem, tight, state, told(problem, 1.0, 1.0))
    assert state.image.min() == 1499.5
    assert state.image.max() == 1500.5


BAND = Band(2e5, 4e5, 1e-3, 8, 32, 1e-3)
PERIOD_S = 1.0 / 3e5


@given(part=st.floats(0.01, 0.5))
def test_a_shifted_tone_at_the_middle_of_the_band_gives_its_shift(part):
    turn = 2.0 * np.pi * np.arange(1000) / 1000
    first, other = np.cos(turn), np.cos(turn - 2.0 * np.pi * part)
    misfit = 0.5 * ((first - other) ** 2).sum() / (first**2).sum()
    assert shift_s(misfit, BAND) == pytest.approx(part * PERIOD_S, rel=1e-6)


def test_a_shift_is_at_most_half_a_period():
    assert shift_s(0.0, BAND) == 0.0
    assert shift_s(2.0, BAND) == shift_s(2.7, BAND) == pytest.approx(0.5 * PERIOD_S)


@pytest.mark.parametrize(
    ("over", "skipped", "given"),
    [
        (True, False, [False, False, True, False]),
        (True, True, [False, True, False, False]),
        (False, False, [False] * 4),
    ],
)
def test_the_image_that_a_finished_band_returned_is_marked(over, skipped, given):
    """The last accepted one, or the one that predicts the held-out emitters best."""
    misfits = ((0.9, 0.5, True), (0.8, 0.4, True), (0.7, 0.6, True), (0.75, 0.1, False))
    history = [Evaluation(*misfit) for misfit in misfits]
    image = Image(np.zeros((2, 2)), 1.0, (0.0, 0.0))
    returned = BandEnd(image, skipped=skipped, history=tuple(history)).given if over else -1
    records = iteration_records(BAND, history, 3, 2, returned, np.nan)
    assert [record.given for record in records] == given
    assert [record.sweep for record in records] == [1, 2, 3, 4]
    assert [record.misfit for record in records] == [0.9, 0.8, 0.7, 0.75]
    assert {record.slice for record in records} == {3}

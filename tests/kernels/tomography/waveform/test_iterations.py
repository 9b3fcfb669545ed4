"""Records of the images of a band: the time shift that a misfit means."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.tomography.waveform.band_inversion import Evaluation
from bentray_kernels.tomography.waveform.iterations import iteration_records, shift_s
from bentray_kernels.tomography.waveform.waveform_settings import Band, WaveSettings

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
    settings = WaveSettings(bands=(BAND,))
    records = iteration_records(settings, 0, history, 3, 2, over=over, skipped=skipped)
    assert [record.given for record in records] == given
    assert [record.sweep for record in records] == [1, 2, 3, 4]
    assert [record.misfit for record in records] == [0.9, 0.8, 0.7, 0.75]
    assert {record.slice for record in records} == {3}

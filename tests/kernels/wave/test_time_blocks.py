"""Blocks of time steps: every step once, the bits of one run, and prompt cancellation."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.tomography.waveform.misfits import correlation
from bentray_kernels.wave import time_blocks as cut
from bentray_kernels.wave.adjoint import misfit_gradient
from bentray_kernels.wave.simulation import simulate

from .test_adjoint import EMITTER, RECEIVERS, STEPS, WAVELET, medium, speeds


class Unheard(Exception):
    """Exception that a poll raises."""


@given(steps=st.integers(0, 5000), nodes=st.integers(1, 10**9))
def test_every_step_is_in_exactly_one_block(steps, nodes):
    polled = []
    listed = list(cut.split_steps(steps, nodes, lambda: polled.append(None)))
    assert [n for first, end in listed for n in range(first, end)] == list(range(steps))
    assert all((end - first) % 2 == 0 for first, end in listed[:-1])
    assert all((end - first - 2) * nodes <= cut.BLOCK for first, end in listed)
    assert len(polled) == len(listed)


@pytest.mark.parametrize("by", ["speed", "attenuation"])
def test_time_blocks_give_the_bits_of_one_run(monkeypatch, by):
    recorded = simulate(medium(speeds(1)), EMITTER, RECEIVERS, WAVELET)
    compare = partial(correlation, recorded=recorded, weight=np.ones((3, 1)))
    whole = misfit_gradient(medium(speeds()), EMITTER, RECEIVERS, WAVELET, compare, 3, by)
    monkeypatch.setattr(cut, "BLOCK", 4 * medium(speeds()).keep.size)
    parts = misfit_gradient(medium(speeds()), EMITTER, RECEIVERS, WAVELET, compare, 3, by)
    assert parts.misfit == whole.misfit
    np.testing.assert_array_equal(parts.gradient, whole.gradient)
    np.testing.assert_array_equal(parts.illumination, whole.illumination)
    again = simulate(medium(speeds(1)), EMITTER, RECEIVERS, WAVELET)
    np.testing.assert_array_equal(again, recorded)


@pytest.mark.parametrize("most", [3, STEPS // 4 + 3])
def test_poll_error_stops_both_directions(monkeypatch, most):
    monkeypatch.setattr(cut, "BLOCK", 4 * medium(speeds()).keep.size)
    polled = []

    def poll():
        polled.append(None)
        if len(polled) == most:
            raise Unheard

    def compare(traces):
        return 0.0, traces

    with pytest.raises(Unheard):
        misfit_gradient(medium(speeds()), EMITTER, RECEIVERS, WAVELET, compare, poll=poll)
    assert len(polled) == most

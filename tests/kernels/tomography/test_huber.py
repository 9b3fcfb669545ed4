"""Huber's loss: its value, and the limit that the residuals' own spread gives."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.tomography import huber


def test_far_residuals_move_the_limit_as_little_as_they_add_to_the_loss():
    residual = np.array([*np.linspace(-2e-8, 2e-8, 99), 5e-6])
    limit = huber.limit(residual, 3.0)
    assert limit == pytest.approx(3.0 * np.median(np.abs(residual)) / 0.6745)
    assert huber.limit(residual, 3.0, 1e-9) == 1e-9
    assert huber.limit(residual, 0.0) == np.inf
    assert huber.loss(residual, np.inf) == pytest.approx(np.sqrt((residual**2).mean()))
    assert huber.loss(residual, limit) < 0.2 * huber.loss(residual, np.inf)
    assert huber.clipped_rms(residual, limit) < huber.loss(residual, limit)


@given(st.floats(1e-9, 1e-6), st.floats(1e-9, 1e-6))
def test_the_loss_is_that_of_huber(size, limit):
    loss = 0.5 * size**2 if size <= limit else limit * (size - 0.5 * limit)
    assert huber.loss(np.array([size, -size]), limit) == pytest.approx(np.sqrt(2.0 * loss))


def test_residuals_that_are_all_zero_have_no_limit():
    assert huber.limit(np.zeros(5), 3.0) == np.inf

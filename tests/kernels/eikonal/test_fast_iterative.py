"""The active list: the same equations as fast marching and sweeping, so the same times."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels import eikonal
from bentray_kernels.errors import InvalidInput

from ...effort import effort

SHAPES = st.one_of(
    st.tuples(st.integers(1, 14), st.integers(1, 14)),
    st.tuples(st.integers(1, 7), st.integers(1, 7), st.integers(1, 7)),
)


def rough_problem(seed, shape):
    """Speeds without any smoothness, and a source anywhere."""
    rng = np.random.default_rng(seed)
    return rng.uniform(0.2, 5.0, shape), rng.uniform(0.0, 1.0, len(shape)) * (np.array(shape) - 1)


@given(seed=st.integers(0, 2**32 - 1), shape=SHAPES)
@settings(max_examples=effort(20, 60), deadline=None)
def test_equals_marching_and_sweeping(seed, shape):
    speed, source = rough_problem(seed, shape)
    tof = eikonal.solve(speed, 1.0, source, "fim")
    assert np.allclose(tof, eikonal.solve(speed, 1.0, source, "fmm", order=1), rtol=1e-11)
    assert np.allclose(tof, eikonal.solve(speed, 1.0, source, "fsm"), rtol=1e-11)


def test_front_turns_back_round_a_wall():
    """A slow wall with a gap: times fall again long after a node was first reached."""
    speed = np.ones((40, 40))
    speed[10::10] = 1e-3
    speed[10, -1] = speed[20, 0] = speed[30, -1] = 1.0
    tof = eikonal.solve(speed, 1.0, (0.0, 0.0), "fim")
    assert tof[-1, 0] > 120.0
    assert np.allclose(tof, eikonal.solve(speed, 1.0, (0.0, 0.0), "fmm", order=1), rtol=1e-11)


def test_tolerance_bounds_the_error_and_zero_is_allowed():
    speed, source = rough_problem(5, (30, 30))
    exact = eikonal.solve(speed, 1.0, source, "fim", tolerance=0.0)
    coarse = eikonal.solve(speed, 1.0, source, "fim", tolerance=1e-2)
    # At most so much is lost at each node of a path.
    assert 0.0 < (coarse - exact).max() < 1e-2 / speed.min() * 60
    assert (coarse >= exact - 1e-12).all()


@pytest.mark.parametrize("tolerance", [-1.0, float("nan")])
def test_bad_tolerance_is_named(tolerance):
    with pytest.raises(InvalidInput, match=r"tolerance.*>= 0"):
        eikonal.solve(np.ones((3, 3)), 1.0, (1.0, 1.0), "fim", tolerance=tolerance)

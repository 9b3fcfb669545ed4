"""The active list, compiled and on OpenCL: the equations, and so the times, of marching and sweeping."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels import eikonal
from bentray_kernels.errors import InvalidInput
from bentray_kernels.opencl import OpenCLFallbackWarning, device_selection

from ...effort import effort

SHAPES = st.one_of(st.tuples(*[st.integers(1, 26)] * 2), st.tuples(*[st.integers(1, 10)] * 3))
each_engine = pytest.mark.parametrize("method", ["fim", pytest.param("fim-opencl", marks=pytest.mark.opencl)])


def rough_problems(seed, shape, batch):
    """Speeds without any smoothness, and sources anywhere."""
    rng = np.random.default_rng(seed)
    speeds = rng.uniform(0.2, 5.0, (batch, *shape))
    return speeds, rng.uniform(0.0, 1.0, (batch, len(shape))) * (np.array(shape) - 1)


@given(seed=st.integers(0, 2**32 - 1), shape=SHAPES)
@settings(max_examples=effort(20, 60), deadline=None)
def test_equals_marching_and_sweeping(seed, shape):
    (speed,), (source,) = rough_problems(seed, shape, 1)
    tof = eikonal.solve(speed, 1.0, source, "fim")
    assert np.allclose(tof, eikonal.solve(speed, 1.0, source, "fmm", order=1), rtol=1e-11)
    assert np.allclose(tof, eikonal.solve(speed, 1.0, source, "fsm"), rtol=1e-11)


@pytest.mark.opencl
@given(seed=st.integers(0, 2**32 - 1), shape=SHAPES, batch=st.integers(1, 5))
@settings(max_examples=effort(20, 50), deadline=None)
def test_equals_fim_and_a_batch_equals_one_by_one(seed, shape, batch):
    speeds, sources = rough_problems(seed, shape, batch)
    many = eikonal.solve_many(speeds, 1.0, sources, "fim-opencl")
    for speed, source, computed in zip(speeds, sources, many, strict=True):
        assert np.allclose(computed, eikonal.solve(speed, 1.0, source, "fim"), rtol=1e-11, atol=1e-15)
        assert np.array_equal(computed, eikonal.solve(speed, 1.0, source, "fim-opencl"))


@each_engine
def test_front_turns_back_round_a_wall(method):
    """A slow wall with a gap: times fall again long after a node was first reached."""
    speed = np.ones((40, 40))
    speed[10::10] = 1e-3
    speed[10, -1] = speed[20, 0] = speed[30, -1] = 1.0
    tof = eikonal.solve(speed, 1.0, (0.0, 0.0), method)
    assert tof[-1, 0] > 120.0
    assert np.allclose(tof, eikonal.solve(speed, 1.0, (0.0, 0.0), "fmm", order=1), rtol=1e-11)


@each_engine
def test_tolerance_bounds_the_error_and_zero_is_allowed(method):
    (speed,), (source,) = rough_problems(5, (40, 40), 1)
    exact, coarse = (eikonal.solve(speed, 1.0, source, method, tolerance=t) for t in (0.0, 0.1))
    # At most so much is lost at each node of a path.
    assert 0.0 < (coarse - exact).max() < 0.1 / speed.min() * 80
    assert (coarse >= exact - 1e-12).all()
    for tolerance in (-1.0, float("nan")):
        with pytest.raises(InvalidInput, match=r"tolerance.*>= 0"):
            eikonal.solve(speed, 1.0, source, method, tolerance=tolerance)


@pytest.mark.opencl
def test_threads_share_the_device_without_mixing_problems():
    speeds, sources = rough_problems(7, (33, 30), 12)
    alone = eikonal.solve_many(speeds, 1.0, sources, "fim-opencl")
    with ThreadPoolExecutor(4) as pool:
        listed = list(pool.map(lambda s, x: eikonal.solve(s, 1.0, x, "fim-opencl"), speeds, sources))
    assert np.array_equal(np.stack(listed), alone)


def test_without_a_device_fim_runs_with_a_warning(monkeypatch):
    speeds, sources = rough_problems(9, (12, 15), 3)
    expected = eikonal.solve_many(speeds, 1.0, sources, "fim")
    monkeypatch.setattr(
        device_selection, "_found", lambda *_: "Fast Platform:GPU 9000 was refused: double1: wrong sqrt"
    )
    device_selection._warn_once.cache_clear()
    with pytest.warns(
        OpenCLFallbackWarning, match="fim takes over: Fast Platform:GPU 9000 was refused"
    ) as caught:
        computed = eikonal.solve_many(speeds, 1.0, sources, "fim-opencl")
    assert len(caught) == 1
    assert np.array_equal(computed, expected)
    device_selection._warn_once.cache_clear()

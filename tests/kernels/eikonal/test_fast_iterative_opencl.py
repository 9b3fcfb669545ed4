"""The fast iterative method on OpenCL: the times of ``fim``, from a device or with a warning without one."""

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


def rough_problems(seed, shape, batch):
    """Speeds without any smoothness, and sources anywhere."""
    rng = np.random.default_rng(seed)
    speeds = rng.uniform(0.2, 5.0, (batch, *shape))
    return speeds, rng.uniform(0.0, 1.0, (batch, len(shape))) * (np.array(shape) - 1)


@pytest.mark.opencl
@given(seed=st.integers(0, 2**32 - 1), shape=SHAPES, batch=st.integers(1, 5))
@settings(max_examples=effort(20, 50), deadline=None)
def test_equals_fim_and_a_batch_equals_one_by_one(seed, shape, batch):
    speeds, sources = rough_problems(seed, shape, batch)
    many = eikonal.solve_many(speeds, 1.0, sources, "fim-opencl")
    for speed, source, computed in zip(speeds, sources, many, strict=True):
        assert np.allclose(computed, eikonal.solve(speed, 1.0, source, "fim"), rtol=1e-11, atol=1e-15)
        assert np.array_equal(computed, eikonal.solve(speed, 1.0, source, "fim-opencl"))


@pytest.mark.opencl
def test_the_front_turns_back_through_many_blocks():
    speed = np.ones((40, 40))
    speed[10::10] = 1e-3
    speed[10, -1] = speed[20, 0] = speed[30, -1] = 1.0
    tof = eikonal.solve(speed, 1.0, (0.0, 0.0), "fim-opencl")
    assert np.allclose(tof, eikonal.solve(speed, 1.0, (0.0, 0.0), "fmm", order=1), rtol=1e-11)


@pytest.mark.opencl
def test_threads_share_the_device_without_mixing_problems():
    speeds, sources = rough_problems(7, (33, 30), 12)
    alone = eikonal.solve_many(speeds, 1.0, sources, "fim-opencl")
    with ThreadPoolExecutor(4) as pool:
        listed = list(pool.map(lambda s, x: eikonal.solve(s, 1.0, x, "fim-opencl"), speeds, sources))
    assert np.array_equal(np.stack(listed), alone)


@pytest.mark.opencl
def test_no_problems_give_no_times():
    assert eikonal.solve_many(np.ones((0, 4, 5)), 1.0, np.ones((0, 2)), "fim-opencl").shape == (0, 4, 5)


@pytest.mark.opencl
def test_tolerance_is_used_and_checked():
    (speed,), (source,) = rough_problems(8, (40, 40), 1)
    fine = eikonal.solve(speed, 1.0, source, "fim-opencl", tolerance=0.0)
    coarse = eikonal.solve(speed, 1.0, source, "fim-opencl", tolerance=0.1)
    assert 0.0 < (coarse - fine).max() < 0.1 / speed.min() * 80
    with pytest.raises(InvalidInput, match=r"tolerance.*>= 0"):
        eikonal.solve(speed, 1.0, source, "fim-opencl", tolerance=-1.0)


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

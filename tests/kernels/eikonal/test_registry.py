"""Several problems in one call: neither the batch nor the threads that share it change a time."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels import eikonal
from bentray_kernels.errors import InvalidInput

METHODS = [name for name in eikonal.methods() if not eikonal.METHODS[name].on_device]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("shape", [(13, 9), (6, 5, 7)])
@given(seed=st.integers(0, 2**32 - 1), batch=st.integers(1, 9), threads=st.integers(1, 4))
@settings(max_examples=5, deadline=None)
def test_threads_and_batches_keep_the_bits(method, shape, seed, batch, threads):
    rng = np.random.default_rng(seed)
    speeds = rng.uniform(0.3, 3.0, (batch, *shape))
    sources = rng.uniform(0.0, 1.0, (batch, len(shape))) * (np.array(shape) - 1)
    many = eikonal.solve_many(speeds, 1.0, sources, method, threads=threads)
    for speed, source, tof in zip(speeds, sources, many, strict=True):
        assert np.array_equal(tof, eikonal.solve(speed, 1.0, source, method))
    shared = eikonal.solve_many(speeds[:1], 1.0, sources, method, threads=threads)
    for source, tof in zip(sources, shared, strict=True):
        assert np.array_equal(tof, eikonal.solve(speeds[0], 1.0, source, method))


def test_an_empty_batch_gives_no_times():
    assert eikonal.solve_many(np.ones((0, 3, 4)), 1.0, np.ones((0, 2)), "fsm", threads=2).shape == (0, 3, 4)


def test_an_error_in_a_thread_reaches_the_caller():
    speeds = np.ones((4, 3, 3))
    speeds[3, 1, 2] = -1.0
    with pytest.raises(InvalidInput, match=r"node \(1, 2\)"):
        eikonal.solve_many(speeds, 1.0, [[1.0, 1.0]], threads=2)


def test_threads_must_be_a_number_from_one():
    with pytest.raises(InvalidInput, match="threads: found 0"):
        eikonal.solve_many(np.ones((1, 3, 3)), 1.0, [[1.0, 1.0]], threads=0)

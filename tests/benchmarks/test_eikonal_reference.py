"""Reference times of E11: right times pass, one damaged time does not."""

import numpy as np
import pytest
from benchmarks.eikonal._reference_times import edge_times, equation_error
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels import eikonal


def rough(seed, ndim):
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 9, ndim))
    return 10.0 ** rng.uniform(-2.0, 2.0, shape), rng.uniform(0.0, 1.0, ndim) * (np.array(shape) - 1)


@pytest.mark.parametrize("ndim", [2, 3])
@given(seed=st.integers(0, 2**32 - 1))
def test_first_order_methods_solve_the_equation_and_none_is_much_later_than_along_edges(ndim, seed):
    speed, source = rough(seed, ndim)
    latest = edge_times(speed, source)
    for method, options in (("fsm", {}), ("fim", {}), ("fmm", {"order": 1}), ("fmm", {}), ("accurate", {})):
        tof = eikonal.solve(speed, 1.0, source, method, **options)
        if method in ("fsm", "fim") or options:
            assert equation_error(tof, speed, source) < 1e-9
        assert (tof <= (1.25 if method == "accurate" else 1.0 + 1e-9) * latest).all()


@pytest.mark.parametrize("factor", [0.999, 1.001])
def test_one_time_off_by_a_thousandth_is_an_error(factor):
    rng = np.random.default_rng(2)
    speed, source = 10.0 ** rng.uniform(-2.0, 2.0, (7, 8)), np.array([1.3, 2.6])
    tof = eikonal.solve(speed, 1.0, source, "fsm")
    for node in ((5, 6), (0, 0), (1, 4)):
        damaged = tof.copy()
        damaged[node] *= factor
        assert equation_error(damaged, speed, source) > 1e-4


def test_edges_of_a_uniform_grid_take_their_number_of_nodes():
    times = edge_times(np.full((6, 7), 2.0), np.array([2.0, 3.0]))
    assert np.allclose(times, 0.5 * np.abs(np.indices((6, 7)) - np.array([[[2]], [[3]]])).sum(axis=0))
    slow = np.full((3, 3), 2.0)
    slow[1] = 1.0
    assert edge_times(slow, np.array([0.0, 0.5]))[2, 0] == pytest.approx(0.25 + 2.0)

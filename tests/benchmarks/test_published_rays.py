"""Rows of rays and wave fronts: exact times and arcs, and what B-splines and first order do to them."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.published._published_rays import distance_from_arcs, exact_times, front_rows, times_of

from bentray_kernels import eikonal


def test_times_are_those_of_the_medium():
    times = exact_times(61)
    np.testing.assert_allclose(times, times_of("accurate", 61), atol=3e-4)
    # |∇T| = 1/(1 + 4x), away from the source.
    slopes = np.hypot(*np.gradient(times, 1.0 / 60))[10:-5, 20:-5]
    speed = 1.0 + 4.0 * np.linspace(0.0, 1.0, 61)[10:-5, None]
    np.testing.assert_allclose(slopes * speed, 1.0, atol=5e-3)


def test_b_splines_follow_the_arcs_of_exact_times_better():
    times = exact_times(65)
    assert distance_from_arcs(times, "bspline") < 0.3 * distance_from_arcs(times, "differences") < 0.005


def test_rows_compare_first_order_with_each_solver():
    rows = {row.target: row for row in front_rows(True)}
    assert rows["first-order FMM / hafmm, error"].value > 100.0
    assert 2.0 < rows["first-order FMM / fmm, error"].value < 20.0
    assert all(row.met for row in rows.values())


@pytest.mark.parametrize("method", [m.name for m in eikonal.METHODS.values() if "fmm" in m.name])
def test_the_order_of_each_front_is_stated(method):
    errors = []
    for nodes in (61, 121):
        off = times_of(method, nodes) - exact_times(nodes)
        errors.append(np.sqrt((off[:, round(0.9 * (nodes - 1))] ** 2).mean()))
    rate = np.log2(errors[0] / errors[1])
    assert rate > eikonal.METHODS[method].order - 0.4
    assert rate < eikonal.METHODS[method].order + 0.75

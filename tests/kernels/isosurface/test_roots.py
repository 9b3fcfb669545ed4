"""Roots along a ray: Brent's method on a spline, and the first root of a cubic."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from bentray_kernels.compilation.compiled import kernel
from bentray_kernels.isosurface.roots import Ray, brent, field_at, first_root_of_cubic, ray_of
from bentray_kernels.splines import Spline
from bentray_kernels.splines.sampler import Sampler, sampler_of

from ...effort import effort


@kernel
def root(field: Sampler, ray: Ray, target: float, a: float, b: float, tolerance: float) -> float:
    ends = field_at(field, ray, a), field_at(field, ray, b)
    return brent(field, ray, target, a, ends[0], b, ends[1], tolerance)


@kernel
def cubic_root(c0: float, c1: float, c2: float, c3: float) -> float:
    return first_root_of_cubic(c0, c1, c2, c3)


@pytest.mark.parametrize("target", [0.001, 1.0, 7.3, 26.9])
def test_brent_finds_the_place_of_a_value(target):
    # A cubic along x, which the spline reproduces away from its mirrored ends.
    nodes = ((np.arange(80.0) - 38.0) ** 3)[:, None, None] + np.zeros((1, 4, 4))
    spline = Spline(nodes)
    ray = ray_of((38.0, 1.5, 1.5), (2.0, 0.0, 0.0))
    found = root(sampler_of(spline), ray, target, 0.0, 1.5, 1e-12)
    assert 2.0 * found == pytest.approx(np.cbrt(target), abs=1e-8)


coefficient = st.floats(-4.0, 4.0).map(lambda x: round(x, 3))


@given(c=st.tuples(coefficient, coefficient, coefficient, coefficient))
@settings(deadline=None, max_examples=effort(20, 500))
def test_the_first_root_of_a_cubic(c):
    assume(any(c))
    roots = np.roots(c[::-1])
    real = np.sort(roots[np.abs(roots.imag) < 1e-9].real)
    inside = real[(real > 1e-6) & (real < 1.0 - 1e-6)]
    # Roots closer together than rounding can part, or at an end, may fall either way.
    slope = np.polyval(np.polyder(c[::-1]), roots)
    assume(not len(roots) or np.abs(slope).min() > 1e-4)
    assume(all(abs(r) > 1e-6 and abs(r - 1.0) > 1e-6 for r in roots))
    found = cubic_root(*c)
    if len(inside):
        assert found == pytest.approx(inside[0], abs=1e-9)
    else:
        assert np.isinf(found)

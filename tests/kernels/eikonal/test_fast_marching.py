"""Fast marching, tidy or not: neither mirrors nor transposes change a time, though seeds and fronts tie."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels import eikonal

from ...effort import effort


def layered_speed(seed, shape, axes):
    """A speed of a few plane waves, within a factor of two, that does not change along the other axes."""
    rng = np.random.default_rng(seed)
    grids = np.meshgrid(*[np.linspace(0.0, 1.0, n) for n in shape], indexing="ij")
    waves = (
        np.sin(
            2.0 * np.pi * sum(k * x for k, x in zip(rng.normal(size=len(shape)) * axes, grids, strict=True))
        )
        for _ in range(3)
    )
    return 1.5 + 0.16 * sum(waves)


@pytest.mark.parametrize(("method", "order"), [("fmm", 1), ("fmm", 2), ("fmm-untidy", 2)])
@pytest.mark.parametrize("shape", [(16, 13), (8, 9, 7)], ids=["2d", "3d"])
@given(
    seed=st.integers(0, 2**32 - 1),
    axes=st.tuples(*[st.booleans()] * 3),
    halves=st.tuples(*[st.integers(0, 12)] * 3),
)
@settings(max_examples=effort(20, 40), deadline=None)
def test_sources_in_the_middle_of_a_cell_give_mirrored_times_in_a_mirror(
    method, order, shape, seed, axes, halves
):
    """Where the medium does not change along an axis, all times tie in pairs across the source."""
    speed = layered_speed(seed, shape, axes[: len(shape)])
    extent = 0.1 * (np.array(shape) - 1)
    source = 0.05 * np.array(halves[: len(shape)])
    tof = eikonal.solve(speed, 0.1, source, method, order=order)
    for axis in range(len(shape)):
        mirrored = np.where(np.arange(len(shape)) == axis, extent - source, source)
        flipped = eikonal.solve(np.flip(speed, axis), 0.1, mirrored, method, order=order)
        assert np.allclose(np.flip(flipped, axis), tof, rtol=1e-9, atol=1e-12)
    assert np.allclose(
        eikonal.solve(speed.T, 0.1, source[::-1], method, order=order).T, tof, rtol=1e-9, atol=1e-12
    )


@pytest.mark.parametrize("method", ["accurate", "hafmm", "fmm", "fmm-untidy"])
@pytest.mark.parametrize("ndim", [2, 3])
@given(
    seed=st.integers(0, 2**32 - 1),
    speed_unit=st.sampled_from([1e-3, 7.0, 1500.0]),
    length_unit=st.sampled_from([1e-4, 1.0, 30.0]),
)
@settings(max_examples=10, deadline=None)
def test_units_of_length_and_speed_change_no_time_but_its_unit(method, ndim, seed, speed_unit, length_unit):
    rng = np.random.default_rng(seed)
    shape = (11, 9) if ndim == 2 else (6, 5, 7)
    speed, source = rng.uniform(1.0, 3.0, shape), rng.uniform(0.0, 1.0, ndim) * (np.array(shape) - 1)
    plain = eikonal.solve(speed, 1.0, source, method)
    scaled = eikonal.solve(speed_unit * speed, length_unit, length_unit * source, method)
    assert np.allclose(scaled * speed_unit / length_unit, plain, rtol=1e-9, atol=1e-12)

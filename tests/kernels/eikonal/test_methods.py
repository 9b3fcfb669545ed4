"""Requirements on every Eikonal method; a new method inherits the suite by its name in the registry."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels import eikonal
from bentray_kernels.errors import InvalidInput

from ...effort import effort
from ...opencl import methods


def four_decade_problem(seed, longest, ndim):
    """Speeds over four decades and a source anywhere, on a corner, on a node or in the middle of a cell."""
    rng = np.random.default_rng(seed)
    shape = rng.integers(1, longest + 1, ndim)
    if rng.random() < 0.2:
        shape[rng.integers(ndim)] = 1
    decades = rng.uniform(-2.0, 2.0, shape)
    if rng.random() < 0.3:
        decades = np.where(decades > 0.0, 2.0, -2.0)
    position = rng.random(ndim) * (shape - 1)
    corner = (shape - 1) * rng.integers(0, 2, ndim)
    middle = np.minimum(np.floor(position) + 0.5, shape - 1)
    return 10.0**decades, (position, corner, np.round(position), middle)[rng.integers(4)]


def smooth_speed(seed, shape):
    """A speed of a few plane waves, within a factor of two."""
    rng = np.random.default_rng(seed)
    grids = np.meshgrid(*[np.linspace(0.0, 1.0, n) for n in shape], indexing="ij")
    waves = sum(
        np.sin(2.0 * np.pi * sum(k * x for k, x in zip(rng.normal(size=len(shape)), grids, strict=True)))
        for _ in range(3)
    )
    return 1.5 + 0.16 * waves


def gradient_problem(shape, position):
    """Speed 1 + 4x on the unit cube and the exact travel time from ``position``."""
    spacing = 1.0 / (shape[0] - 1)
    grids = np.meshgrid(*[np.arange(n) * spacing for n in shape], indexing="ij")
    speed = 1.0 + 4.0 * grids[0]
    squared = sum((x - p) ** 2 for x, p in zip(grids, position, strict=True))
    exact = np.arccosh(1.0 + 16.0 * squared / (2.0 * speed * (1.0 + 4.0 * position[0]))) / 4.0
    return speed, spacing, exact


def test_default_comes_first():
    assert eikonal.methods()[0] == "accurate"
    speed = smooth_speed(1, (9, 9))
    assert np.array_equal(
        eikonal.solve(speed, 0.1, (0.1, 0.2)), eikonal.solve(speed, 0.1, (0.1, 0.2), "accurate")
    )


def test_converges_with_its_order(method, ndim):
    ring = []
    for n in (17, 33, 65) if ndim == 3 else (33, 65, 129):
        speed, spacing, exact = gradient_problem((n,) * ndim, (0.5, 0.47, 0.52)[:ndim])
        error = np.abs(eikonal.solve(speed, spacing, (0.5, 0.47, 0.52)[:ndim], method) - exact)
        away = (
            np.sqrt(sum((g - 0.5) ** 2 for g in np.meshgrid(*[np.linspace(0, 1, n)] * ndim, indexing="ij")))
            > 0.35
        )
        ring.append(np.sqrt((error[away] ** 2).mean()))
    rate = np.log2(ring[0] / ring[2]) / 2.0
    chosen = eikonal.METHODS[method]
    assert rate > (1.5 if chosen.order == 2 else 0.75)


@pytest.mark.parametrize("method", [m.name for m in eikonal.METHODS.values() if m.factored])
def test_factored_methods_are_exact_in_a_homogeneous_medium(method, ndim):
    source = np.array([0.031, 0.077, 0.05])[:ndim]
    tof = eikonal.solve(np.full((14,) * ndim, 2.0), 0.01, source, method)
    grids = np.meshgrid(*[np.arange(14) * 0.01] * ndim, indexing="ij")
    exact = np.sqrt(sum((g - s) ** 2 for g, s in zip(grids, source, strict=True))) / 2.0
    assert np.allclose(tof, exact, rtol=1e-10, atol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize(("ndim", "longest"), [(2, 12), (3, 7)], ids=["2d", "3d"])
def test_models_over_four_decades_give_times(ndim, longest):
    for seed in range(effort(100, 10_000)):
        speed, source = four_decade_problem(seed, longest, ndim)
        marched = eikonal.solve(speed, 1.0, source, "fmm", order=1)
        for chosen in map(eikonal.METHODS.__getitem__, methods()):
            # A call to a device takes as long as twenty solves.
            if chosen.on_device and seed % 20 != 0:
                continue
            tof = eikonal.solve(speed, 1.0, source, chosen.name)
            assert np.isfinite(tof).all(), (chosen.name, seed)
            assert (tof >= 0.0).all(), (chosen.name, seed)
            if chosen.differences == 1:
                assert np.allclose(tof, marched, rtol=1e-9, atol=0.0), (chosen.name, seed)


@given(
    seed=st.integers(0, 2**32 - 1),
    axis=st.integers(0, 1),
    # Between the nodes, in the middle of a cell, and halfway between two nodes.
    source=st.sampled_from([(0.23, 0.61), (0.35, 0.65), (0.3, 0.65)]),
)
@settings(max_examples=effort(20, 40), deadline=None)
def test_result_is_invariant_to_flips_and_transposes(seed, axis, source):
    speed = smooth_speed(seed, (11, 11))
    source = np.array(source)
    for method in methods():
        tof = eikonal.solve(speed, 0.1, source, method)
        mirrored = source.copy()
        mirrored[axis] = 1.0 - source[axis]
        flipped = eikonal.solve(np.flip(speed, axis), 0.1, mirrored, method)
        # Ties of the first-order sweep may fall the other way round in a mirror: second-order size.
        close = 2e-3 if method == "accurate" else 1e-9
        assert np.allclose(np.flip(flipped, axis), tof, rtol=close, atol=1e-12), method
        assert np.allclose(
            eikonal.solve(speed.T, 0.1, source[::-1], method).T, tof, rtol=close, atol=1e-12
        ), method


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


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_slower_media_are_later(seed):
    """Monotone in slowness; strictly so for the first-order schemes, to their error for the others."""
    rng = np.random.default_rng(seed)
    speed = smooth_speed(seed, (12, 12))
    slower = speed * rng.uniform(0.8, 1.0, speed.shape)
    for method in methods():
        before = eikonal.solve(speed, 0.1, (0.4, 0.5), method)
        after = eikonal.solve(slower, 0.1, (0.4, 0.5), method)
        slack = 1e-12 if method in ("fsm", "fim", "fim-opencl") else 0.02 * before.max()
        assert (after >= before - slack).all()


def test_reciprocity_on_a_smooth_model(method):
    gaps = []
    for n in (65, 129):
        speed, spacing = smooth_speed(5, (n, n)), 1.0 / (n - 1)
        a, b = np.array([10, 20]) * (n // 64), np.array([55, 40]) * (n // 64)
        there = eikonal.solve(speed, spacing, a * spacing, method)[tuple(b)]
        back = eikonal.solve(speed, spacing, b * spacing, method)[tuple(a)]
        gaps.append(abs(there / back - 1.0))
    chosen = eikonal.METHODS[method]
    assert gaps[0] < (5e-4 if chosen.factored else 1e-2)
    assert gaps[1] < gaps[0] * (0.35 if chosen.factored else 0.8)


def test_one_node_wide_grids_are_the_integral_along_the_line(method):
    speed = smooth_speed(7, (40, 1))
    tof = eikonal.solve(speed, 0.1, (0.0, 0.0), method)
    exact = np.concatenate(([0.0], np.cumsum(0.05 * (1 / speed[1:, 0] + 1 / speed[:-1, 0]))))
    assert np.allclose(tof[:, 0], exact, atol=0.1 * (1 / speed).max())
    assert (np.diff(tof[:, 0]) > 0.0).all()
    assert eikonal.solve([[3.0]], 0.1, (0.0, 0.0), method) == 0.0


def test_every_corner_may_be_the_source(method, ndim):
    speed = np.full((6,) * ndim, 3.0)
    for corner in np.ndindex(*(2,) * ndim):
        node = tuple(5 * c for c in corner)
        tof = eikonal.solve(speed, 0.2, np.array(node) * 0.2, method)
        assert tof[node] == 0.0
        assert tof.argmax() == np.ravel_multi_index(tuple(5 - n for n in node), speed.shape)


def test_float32_and_lists_are_computed_in_double(method):
    single = np.full((8, 8), 1500.0, np.float32)
    tof = eikonal.solve(single, 1e-3, (2e-3, 2e-3), method)
    assert tof.dtype == np.float64
    assert np.array_equal(tof, eikonal.solve(single.astype(float).tolist(), 1e-3, (2e-3, 2e-3), method))


def test_inputs_are_left_alone(method):
    speed, source = smooth_speed(3, (9, 9)), np.array([0.2, 0.3])
    kept = speed.copy(), source.copy()
    eikonal.solve(speed, 0.1, source, method)
    assert np.array_equal(speed, kept[0])
    assert np.array_equal(source, kept[1])


@pytest.mark.parametrize(
    ("change", "field", "words"),
    [
        ({"speed": np.array([[1.0, 2.0], [0.0, 1.0]])}, "speed", "node (1, 0)"),
        ({"speed": np.array([[1.0, np.nan], [1.0, 1.0]])}, "speed", "node (0, 1)"),
        ({"speed": np.array([[1.0, -2.0], [1.0, 1.0]])}, "speed", "-2"),
        ({"speed": np.ones(4)}, "speed", "2-D or 3-D"),
        ({"speed": np.ones((0, 3))}, "speed", "non-empty"),
        ({"spacing": 0.0}, "spacing", "> 0"),
        ({"spacing": float("nan")}, "spacing", "finite"),
        ({"source": (0.5,)}, "source", "2 coordinates"),
        ({"source": (0.5, 1.2)}, "source", "a point in the grid"),
        ({"source": (-0.1, 0.5)}, "source", "a point in the grid"),
        ({"source": (np.nan, 0.5)}, "source", "a point in the grid"),
        ({"method": "magic"}, "method", "accurate, fmm, hafmm, fsm"),
        ({"tolerance": 1.0, "method": "fmm"}, "options", "order"),
        ({"order": 3, "method": "fmm"}, "order", "1 or 2"),
        ({"tolerance": -1.0, "method": "fsm"}, "tolerance", ">= 0"),
    ],
)
def test_bad_input_is_named(change, field, words):
    arguments = {"speed": np.ones((2, 2)), "spacing": 1.0, "source": (0.5, 0.5), **change}
    with pytest.raises(InvalidInput) as refusal:
        eikonal.solve(**arguments)
    assert refusal.value.field == field
    assert words in str(refusal.value)


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


def test_an_empty_batch_gives_no_times(method):
    assert eikonal.solve_many(np.ones((0, 3, 4)), 1.0, np.ones((0, 2)), method, threads=2).shape == (0, 3, 4)


def test_an_error_in_a_thread_reaches_the_caller():
    speeds = np.ones((4, 3, 3))
    speeds[3, 1, 2] = -1.0
    with pytest.raises(InvalidInput, match=r"node \(1, 2\)"):
        eikonal.solve_many(speeds, 1.0, [[1.0, 1.0]], threads=2)


def test_threads_must_be_a_number_from_one():
    with pytest.raises(InvalidInput, match="threads: found 0"):
        eikonal.solve_many(np.ones((1, 3, 3)), 1.0, [[1.0, 1.0]], threads=0)

"""Sensitivities without rays: the solver's own derivative, and the rays' where those are known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator

from bentray_kernels.eikonal import adjoint, solve
from bentray_kernels.errors import InvalidInput
from bentray_kernels.rays import sensitivities

SHAPES = st.sampled_from([(12, 15), (25, 9), (7, 6, 8)])
SPACING = 2e-3


def scene(shape, seed, receivers=4):
    """A smooth random medium around 1500 m/s, a source and receivers in it, m."""
    rng = np.random.default_rng(seed)
    speed = 1500.0 * (1.0 + 0.15 * rng.uniform(-1.0, 1.0, shape))
    extent = (np.array(shape) - 1) * SPACING
    return rng, speed, rng.uniform(0.0, extent), rng.uniform(0.0, extent, (receivers, len(shape)))


def read(tof, receivers):
    return RegularGridInterpolator([np.arange(n) * SPACING for n in tof.shape], tof)(receivers)


@given(shape=SHAPES, seed=st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_derivative_of_the_first_order_solver(shape, seed):
    rng, speed, source, receivers = scene(shape, seed)
    values = rng.normal(size=len(receivers))
    change = rng.normal(size=shape) * 1e-4 / 1500.0

    def at_receivers(part):
        return values @ read(solve(1.0 / (1.0 / speed + part * change), SPACING, source, "fsm"), receivers)

    slopes = [(at_receivers(part) - at_receivers(-part)) / (2.0 * part) for part in (1.0, 1e-2)]
    tof = solve(speed, SPACING, source, "fsm")
    found = float((adjoint(tof, SPACING, source, receivers, values) * change).sum())
    # Where a node changes neighbours between the two points, the difference depends on the step.
    size = np.abs(values).sum() * np.linalg.norm(np.array(shape) * SPACING) * 1e-4 / 1500.0
    assert min(abs(found - slope) for slope in slopes) < 1e-3 * size


@given(shape=SHAPES, seed=st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_weighted_by_the_slowness_it_is_the_travel_time(shape, seed):
    rng, speed, source, receivers = scene(shape, seed)
    values = rng.normal(size=len(receivers))
    tof = solve(speed, SPACING, source, "fsm")
    worth = adjoint(tof, SPACING, source, receivers, values)
    total = np.abs(values) @ read(tof, receivers)
    assert (worth / speed).sum() == pytest.approx(values @ read(tof, receivers), abs=1e-9 * total)


@given(shape=SHAPES, seed=st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_linear_in_the_values_and_never_negative_for_positive_ones(shape, seed):
    _, speed, source, receivers = scene(shape, seed, receivers=2)
    tof = solve(speed, SPACING, source)
    one, other = (adjoint(tof, SPACING, source, receivers[k : k + 1], [1.0]) for k in range(2))
    both = adjoint(tof, SPACING, source, receivers, [2.0, 3.0])
    assert np.allclose(both, 2.0 * one + 3.0 * other, rtol=1e-12, atol=0.0)
    assert (one >= 0.0).all()
    assert (both[tof > read(tof, receivers).max() + 2.0 * SPACING / speed.min()] == 0.0).all()


@pytest.mark.parametrize("shape", [(80, 80), (30, 30, 30)])
def test_homogeneous_medium_gives_the_distance(shape):
    spacing, speed = 1e-3, np.full(shape, 1480.0)
    source = np.full(len(shape), 3.0 * spacing)
    for end in (np.array(shape) - 4.0, np.where(np.arange(len(shape)) == 0, shape[0] - 4.0, 3.0)):
        receiver = end * spacing
        tof = solve(speed, spacing, source, "fsm")
        length = adjoint(tof, spacing, source, receiver[None], [1.0]).sum()
        distance = np.linalg.norm(receiver - source)
        along_an_axis = np.count_nonzero(receiver != source) == 1
        assert length == pytest.approx(tof[tuple(end.astype(int))] * 1480.0, rel=1e-9)
        # First order is exact along the axes and late between them.
        assert length == pytest.approx(distance, rel=1e-9 if along_an_axis else 0.07)


def test_lies_along_the_rays_with_their_length():
    shape, spacing = (90, 90), 1e-3
    x, y = np.meshgrid(*(np.arange(n) / 89.0 for n in shape), indexing="ij")
    speed = 1500.0 * (1.0 - 0.08 * np.exp(-((x - 0.5) ** 2 + (y - 0.45) ** 2) / 0.03))
    source = np.array([5.2, 40.7]) * spacing
    receivers = np.array([[85.0, 20.0], [84.0, 48.0], [60.0, 86.0]]) * spacing
    tof = solve(speed, spacing, source)
    rows = sensitivities(tof, spacing, receivers, source).toarray()
    places = np.stack([x, y], axis=-1).reshape(-1, 2) * 89.0
    for row, receiver in zip(rows, receivers, strict=True):
        worth = adjoint(tof, spacing, source, receiver[None], [1.0]).ravel()
        assert worth.sum() == pytest.approx(row.sum(), rel=0.03)
        middle, ray_middle = worth @ places / worth.sum(), row @ places / row.sum()
        assert np.linalg.norm(middle - ray_middle) < 1.5
        # The mean distance from the ray stays below the square root of its length in nodes.
        on_ray = places[row > 0.0]
        apart = np.linalg.norm(places[:, None, :] - on_ray[None, :, :], axis=2).min(axis=1)
        assert worth @ apart / worth.sum() < 0.5 * np.sqrt(row.sum() / spacing)


def test_a_receiver_at_the_source_and_none_at_all():
    tof = solve(np.full((9, 9), 1500.0), 1e-3, (4e-3, 4e-3))
    assert not adjoint(tof, 1e-3, (4e-3, 4e-3), [(4e-3, 4e-3)], [1.0]).any()
    assert not adjoint(tof, 1e-3, (4e-3, 4e-3), np.empty((0, 2)), []).any()


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"tof": np.ones(4)}, "tof"),
        ({"tof": np.full((4, 4), np.nan)}, "tof"),
        ({"spacing": 0.0}, "spacing"),
        ({"source": (0.0, 9.0)}, "source"),
        ({"receivers": [(1.0, 1.0, 1.0)]}, "receivers"),
        ({"receivers": [(1.0, 3.5)]}, "receivers"),
        ({"receivers": [(1.0, np.nan)]}, "receivers"),
        ({"values": [1.0, 2.0]}, "values"),
        ({"values": [np.inf]}, "values"),
    ],
)
def test_bad_input_is_named(changes, field):
    good = {
        "tof": np.ones((4, 4)),
        "spacing": 1.0,
        "source": (0.0, 0.0),
        "receivers": [(1.0, 1.0)],
        "values": [1.0],
    }
    with pytest.raises(InvalidInput) as refused:
        adjoint(**{**good, **changes})
    assert refused.value.field == field

"""Rays arrive, are straight where they should be, and integrate to the travel time."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels import eikonal, rays
from bentray_kernels.errors import InvalidInput
from bentray_kernels.rays.fan import _inside, squared_gradient

from ...effort import effort
from ...opencl import methods


def ring(count, radius, centre):
    angle = 2.0 * np.pi * np.arange(count) / count
    return centre + radius * np.column_stack((np.cos(angle), np.sin(angle)))


def test_homogeneous_rays_are_straight():
    points = ring(64, 0.47, 0.5)
    tof = eikonal.solve(np.full((128, 128), 1500.0), 1.0 / 127, points[0])
    for path, receiver in zip(rays.trace(tof, 1.0 / 127, points[1:], points[0]), points[1:], strict=True):
        along = (points[0] - receiver) / np.linalg.norm(points[0] - receiver)
        off = path - receiver
        assert np.abs(off[:, 0] * along[1] - off[:, 1] * along[0]).max() * 127 < 1e-6
        assert np.array_equal(path[0], receiver) or np.allclose(path[0], receiver, atol=1e-12)
        assert np.allclose(path[-1], points[0], atol=1e-12)


def test_ray_in_a_gradient_is_the_known_circle():
    """In a constant gradient rays are circles about a centre where the speed would be 0."""
    n = 201
    spacing = 1.0 / (n - 1)
    speed = np.repeat(1.0 + 4.0 * np.linspace(0, 1, n)[:, None], n, axis=1)
    source, receiver = np.array([0.2, 0.1]), np.array([0.3, 0.9])
    path = rays.trace(eikonal.solve(speed, spacing, source), spacing, [receiver], source)[0]
    # The centre lies on x = -1/4, equally far from both ends.
    y = (receiver[1] ** 2 + (receiver[0] + 0.25) ** 2 - source[1] ** 2 - (source[0] + 0.25) ** 2) / (
        2.0 * (receiver[1] - source[1])
    )
    centre = np.array([-0.25, y])
    radii = np.linalg.norm(path - centre, axis=1)
    assert np.abs(radii / np.linalg.norm(source - centre) - 1.0).max() < 2e-3


def test_steps_are_of_second_order():
    """Down an exact travel time the known circle is met ten times nearer than steps of first order would."""
    n = 101
    x = np.arange(n) / (n - 1)
    source, receiver = np.array([0.2, 0.1]), np.array([0.3, 0.9])
    squared = (x[:, None] - source[0]) ** 2 + (x[None, :] - source[1]) ** 2
    tof = np.arccosh(1.0 + 8.0 * squared / ((1.0 + 4.0 * source[0]) * (1.0 + 4.0 * x[:, None]))) / 4.0
    path = rays.trace(tof, 1.0 / (n - 1), [receiver], source)[0]
    y = (receiver[1] ** 2 + (receiver[0] + 0.25) ** 2 - source[1] ** 2 - (source[0] + 0.25) ** 2) / (
        2.0 * (receiver[1] - source[1])
    )
    radii = np.linalg.norm(path - np.array([-0.25, y]), axis=1)
    assert np.abs(radii / np.linalg.norm(source - np.array([-0.25, y])) - 1.0).max() < 5e-4


@given(factors=st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6), flat=st.booleans())
@settings(max_examples=effort(20, 30), deadline=None)
def test_gradient_of_a_parabola_is_exact_on_the_rim_too(factors, flat):
    shape = (6, 3) if flat else (3, 5, 4)
    strides = tuple(int(np.prod(shape[k + 1 :])) for k in range(len(shape)))
    axes = np.meshgrid(*map(np.arange, shape), indexing="ij")
    terms = [factors[k] * x + factors[k + 3] * x**2 for k, x in enumerate(axes)]
    tof = np.sqrt(sum(terms) + 200.0)
    slope = [factors[k] + 2.0 * factors[k + 3] * x for k, x in enumerate(axes)]
    gradient = squared_gradient(tof.ravel(), shape, strides)
    assert np.allclose(gradient, np.stack([x.ravel() for x in slope], axis=1), atol=1e-9)


def test_slowness_along_the_ray_is_the_travel_time():
    """Fermat: the integral along the traced ray is nearer the exact time than the travel time it follows."""
    n = 128
    spacing = 1.0 / (n - 1)
    x = np.arange(n) * spacing
    speed = np.repeat(1.0 + 4.0 * x[:, None], n, axis=1)
    points = ring(40, 0.45, 0.5)
    exact = (
        np.arccosh(
            1.0
            + 16.0
            * ((points[1:] - points[0]) ** 2).sum(axis=1)
            / (2.0 * (1 + 4 * points[0, 0]) * (1 + 4 * points[1:, 0]))
        )
        / 4.0
    )
    tof = eikonal.solve(speed, spacing, points[0])
    matrix = rays.sensitivities(tof, spacing, points[1:], points[0])
    assert np.abs(matrix @ (1.0 / speed).ravel() - exact).max() < 5e-5
    assert matrix.shape == (39, n * n)


@given(seed=st.integers(0, 2**32 - 1), flat=st.booleans())
@settings(max_examples=effort(20, 40), deadline=None)
def test_no_ray_is_lost_in_rough_models(seed, flat):
    rng = np.random.default_rng(seed)
    shape = (14, 17) if flat else (7, 8, 6)
    last = np.array(shape) - 1.0
    speed = rng.uniform(0.2, 5.0, shape)
    source = rng.uniform(0.0, 1.0, len(shape)) * last
    receivers = rng.uniform(0.0, 1.0, (6, len(shape))) * last
    for method in methods():
        tof = eikonal.solve(speed, 1.0, source, method)
        for path, receiver in zip(rays.trace(tof, 1.0, receivers, source), receivers, strict=True):
            assert np.allclose(path[0], receiver)
            assert np.allclose(path[-1], source)
            assert (path >= 0.0).all()
            assert (path <= last).all()
            steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
            assert steps.max() <= np.sqrt(len(shape)) + 1e-9


@pytest.mark.parametrize("kind", ["curved", "straight"])
@given(seed=st.integers(0, 2**32 - 1), flat=st.booleans())
@settings(max_examples=effort(20, 25), deadline=None)
def test_sensitivities_are_the_lengths_of_the_rays(kind, seed, flat):
    rng = np.random.default_rng(seed)
    shape = (15, 12) if flat else (7, 8, 6)
    last = np.array(shape) - 1.0
    source = rng.uniform(0.0, 1.0, len(shape)) * last
    receivers = rng.uniform(0.0, 1.0, (5, len(shape))) * last
    tof = eikonal.solve(rng.uniform(1.0, 2.0, shape), 0.3, source * 0.3)
    matrix = rays.sensitivities(tof, 0.3, receivers * 0.3, source * 0.3, kind=kind)
    paths = rays.trace(tof, 0.3, receivers * 0.3, source * 0.3, kind=kind)
    lengths = [np.linalg.norm(np.diff(path, axis=0), axis=1).sum() for path in paths]
    assert np.allclose(matrix.sum(axis=1), lengths, rtol=1e-12)
    assert (matrix.data > 0.0).all()
    assert all(len(set(row.indices)) == row.nnz for row in matrix)


def test_straight_rays_need_only_the_grid():
    path = rays.trace(np.zeros((9, 9)), 0.5, [[4.0, 1.0]], (0.0, 0.5), kind="straight")[0]
    assert np.allclose(path[:, 1], 0.5 + path[:, 0] / 8.0)


def test_receiver_on_the_source_has_no_ray():
    tof = eikonal.solve(np.ones((8, 8)), 1.0, (3.0, 3.0))
    for kind in ("curved", "straight"):
        assert rays.sensitivities(tof, 1.0, [[3.0, 3.0]], (3.0, 3.0), kind=kind).sum() == 0.0


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"tof": np.ones(5)}, "tof"),
        ({"tof": np.full((4, 4), np.inf)}, "tof"),
        ({"spacing": -1.0}, "spacing"),
        ({"receivers": [[1.0, 9.0]]}, "receivers"),
        ({"receivers": [[1.0, np.nan]]}, "receivers"),
        ({"receivers": [1.0, 2.0]}, "receivers"),
        ({"source": [1.0, -0.1]}, "source"),
        ({"source": [1.0]}, "source"),
        ({"kind": "wavy"}, "kind"),
    ],
)
def test_bad_input_is_named(change, field):
    arguments = {
        "tof": np.ones((4, 4)),
        "spacing": 1.0,
        "receivers": [[1.0, 2.0]],
        "source": (0.0, 0.0),
        **change,
    }
    with pytest.raises(InvalidInput, match=f"^{field}: found"):
        rays.trace(**arguments)


def test_points_outside_by_rounding_are_moved_onto_the_grid():
    points = np.array([[-1e-10, 3.0], [4.0, 7.0 + 1e-10]])
    inside = _inside("receivers", points, np.array([7.0, 7.0]), 1e-3)
    np.testing.assert_array_equal(inside, [[0.0, 3.0], [4.0, 7.0]])

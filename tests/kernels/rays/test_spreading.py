"""Geometrical spreading: that of known media and of rays that were shot, reciprocal, none past a caustic."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from bentray_kernels import eikonal, rays
from bentray_kernels.errors import InvalidInput

from ...effort import effort
from .problems import rough_problem

CENTRE = np.array([0.45, 0.52, 0.5])
SOURCE = np.array([0.2, 0.23, 0.4])


def nodes(n, ndim):
    """Places of the nodes of a unit cube, (n, …, ndim)."""
    return np.stack(np.meshgrid(*[np.linspace(0.0, 1.0, n)] * ndim, indexing="ij"), axis=-1)


def spread(speed, spacing, receivers, source):
    return rays.spreading(eikonal.solve(speed, spacing, source), speed, spacing, receivers, source)


def places(seed, count, ndim):
    return np.random.default_rng(seed).uniform(0.15, 0.85, (count, ndim))


@pytest.mark.parametrize("ndim", [2, 3])
def test_1_in_a_homogeneous_medium(ndim):
    rng = np.random.default_rng(3)
    source, receivers = rng.uniform(0.0, 1.1, ndim), rng.uniform(0.0, 1.1, (30, ndim))
    assert np.allclose(spread(np.full((12,) * ndim, 1500.0), 0.1, receivers, source), 1.0, rtol=1e-9)


@pytest.mark.parametrize(("ndim", "n", "error"), [(2, 65, 1e-3), (3, 33, 5e-3)])
def test_constant_gradient(ndim, n, error):
    """In the length ds/v the medium v₀ + g·x is a hyperbolic space: a tube is sinh(gT)/g wide, in s."""
    g = 4.0
    receivers = places(2, 60, ndim)
    apart = np.linalg.norm(receivers - SOURCE[:ndim], axis=1)
    here, there = 1.0 + g * SOURCE[0], 1.0 + g * receivers[:, 0]
    cosh = 1.0 + 0.5 * g * g * apart**2 / (here * there)
    exact = (there * np.sqrt(cosh**2 - 1.0) / g / apart) ** (ndim - 1)
    got = spread(1.0 + g * nodes(n, ndim)[..., 0], 1.0 / (n - 1), receivers, SOURCE[:ndim])
    assert np.abs(got / exact - 1.0).max() < error
    assert exact.max() > 1.5


def curved_space(curvature, points, ndim):
    """1 + K/4·ρ² about the centre, of which ds/v makes a space of constant curvature K (stereographic)."""
    return 1.0 + 0.25 * curvature * ((points - CENTRE[:ndim]) ** 2).sum(axis=-1)


@pytest.mark.parametrize("curvature", [8.0, -3.2])
@pytest.mark.parametrize(("ndim", "n", "error"), [(2, 65, 1e-3), (3, 65, 2e-3)])
def test_constant_curvature(ndim, n, error, curvature):
    """Maxwell's fish-eye focuses like the great circles of a sphere; its opposite is the Poincaré disc."""
    receivers = places(2, 60, ndim)
    apart = np.linalg.norm(receivers - SOURCE[:ndim], axis=1)
    here, there = (curved_space(curvature, p, ndim) for p in (SOURCE[:ndim], receivers))
    root = np.sqrt(abs(curvature))
    half = 0.5 * root * apart / np.sqrt(here * there)
    angle = 2.0 * (np.arcsin(half) if curvature > 0.0 else np.arcsinh(half))
    width = there * (np.sin(angle) if curvature > 0.0 else np.sinh(angle)) / root
    got = spread(curved_space(curvature, nodes(n, ndim), ndim), 1.0 / (n - 1), receivers, SOURCE[:ndim])
    exact = (width / apart) ** (ndim - 1)
    assert np.abs(got / exact - 1.0).max() < error
    assert np.abs(exact - 1.0).max() > 0.15


class Waves:
    """A smooth random medium: log slowness is a sum of plane waves, with exact derivatives."""

    def __init__(self, seed, ndim, height=0.012):
        rng = np.random.default_rng(seed)
        self.wave = rng.uniform(-12.0, 12.0, (8, ndim))
        self.phase = rng.uniform(0.0, 2.0 * np.pi, 8)
        self.height = height

    def speed(self, points):
        return np.exp(-self.height * np.sin(points @ self.wave.T + self.phase).sum(axis=-1))

    def slope(self, position):
        return self.height * np.cos(self.wave @ position + self.phase) @ self.wave

    def shoot(self, source, direction, length):
        """End of a ray of that length (d(x)/ds = t, d(t)/ds = ∇u − (∇u·t)·t), and its direction there."""
        ndim = len(source)

        def move(_, state):
            slope, tangent = self.slope(state[:ndim]), state[ndim:]
            return np.concatenate((tangent, slope - (slope @ tangent) * tangent))

        end = solve_ivp(move, (0.0, length), np.concatenate((source, direction)), rtol=1e-10, atol=1e-11)
        return end.y[:ndim, -1], end.y[ndim:, -1]


@pytest.mark.parametrize(("ndim", "n"), [(2, 129), (3, 65)])
def test_neighbouring_rays_are_as_far_apart(ndim, n):
    """Shot with take-off angles that differ a little, without grid, bending or paraxial equations."""
    medium, rng, tilt = Waves(5, ndim, 0.02), np.random.default_rng(6), 1e-4
    source = np.full(ndim, 0.2)
    speed = medium.speed(nodes(n, ndim))
    receivers, exact = [], []
    for k in range(12):
        toward = rng.uniform(0.4, 1.0, ndim)
        if k % 2:
            # In space, as far from one axis as from another: a basis that leant on the nearer one would turn.
            toward[1:] = 0.5
        axes = np.linalg.qr(np.column_stack((toward, rng.normal(size=(ndim, ndim - 1)))))[0]
        direction = toward / np.linalg.norm(toward)
        length = rng.uniform(0.3, 0.7)
        end, tangent = medium.shoot(source, direction, length)
        apart = []
        for across in axes[:, 1:].T:
            ends = [
                medium.shoot(source, np.cos(a) * direction + np.sin(a) * across, length)[0]
                for a in (tilt, -tilt)
            ]
            apart.append((ends[0] - ends[1]) / (2.0 * tilt))
        # The volume over the ray's tangent is the cross-section across it, whatever runs along it.
        receivers.append(end)
        exact.append(
            abs(np.linalg.det(np.column_stack((tangent, *apart))))
            / np.linalg.norm(end - source) ** (ndim - 1)
        )
    got = spread(speed, 1.0 / (n - 1), np.array(receivers), source)
    assert np.abs(got / exact - 1.0).max() < 1e-3
    assert np.abs(np.array(exact) - 1.0).max() > 0.3


@given(seed=st.integers(0, 2**32 - 1), flat=st.booleans())
@settings(max_examples=effort(20, 30), deadline=None)
def test_reciprocal(seed, flat):
    """Tubes there and back differ by the speeds at the ends alone."""
    ndim, n = (2, 60) if flat else (3, 24)
    medium, rng = Waves(seed, ndim, 0.008), np.random.default_rng(seed)
    a, b = rng.uniform(0.15, 0.4, ndim), rng.uniform(0.6, 0.85, ndim)
    speed, spacing = medium.speed(nodes(n, ndim)), 1.0 / (n - 1)
    there, back = spread(speed, spacing, [b], a)[0], spread(speed, spacing, [a], b)[0]
    assert there > 0.0
    assert back / there == pytest.approx((medium.speed(a) / medium.speed(b)) ** (ndim - 1), rel=0.01)


@pytest.mark.parametrize("ndim", [2, 3])
def test_amplitudes_carry_the_speeds_at_the_ends(ndim):
    g, n = 2.0, 33
    speed, receivers = 1.0 + g * nodes(n, ndim)[..., 0], places(4, 20, ndim)
    source, spacing = SOURCE[:ndim], 1.0 / (n - 1)
    tof = eikonal.solve(speed, spacing, source)
    ends = (1.0 + g * source[0]) / (1.0 + g * receivers[:, 0])
    expected = -0.5 * np.log(rays.spreading(tof, speed, spacing, receivers, source) * ends)
    got = rays.log_amplitudes(tof, speed, spacing, receivers, source)
    assert np.allclose(got, expected, atol=1e-3)
    assert np.abs(np.log(ends)).max() > 0.5


@pytest.mark.parametrize("ndim", [2, 3])
def test_a_path_through_a_caustic_has_none(ndim):
    """Straight through the middle of a strong slow lens is stationary, but later than the ways around."""
    n = 81 if ndim == 2 else 41
    square = ((nodes(n, ndim) - 0.5) ** 2).sum(axis=-1)
    speed = 1500.0 * (1.0 - 0.3 * np.exp(-square / 0.01))
    source = np.array([0.05] + [0.5] * (ndim - 1))
    receivers = np.array([[x] + [0.5] * (ndim - 1) for x in (0.25, 0.9)])
    near, behind = spread(speed, 1.0 / (n - 1), receivers, source)
    assert near == pytest.approx(1.0, abs=0.2)
    assert np.isnan(behind)


@given(seed=st.integers(0, 2**32 - 1), flat=st.booleans())
@settings(max_examples=20, deadline=None)
def test_rough_models_give_positive_numbers_or_none(seed, flat):
    speed, source, receivers = rough_problem(seed, flat, 0.5, 2.0)
    got = spread(speed, 1.0, receivers, source)
    assert ((got > 0.0) | np.isnan(got)).all()
    assert not np.isinf(got).any()


def test_neither_units_nor_spacing_matter():
    speed, receivers = Waves(8, 2).speed(nodes(40, 2)), places(5, 8, 2)
    spreading = spread(speed, 1.0 / 39.0, receivers, SOURCE[:2])
    other = spread(1500.0 * speed, 0.01 / 39.0, 0.01 * receivers, 0.01 * SOURCE[:2])
    assert np.allclose(spreading, other, rtol=1e-6)


def test_a_receiver_on_the_source_has_1():
    speed = 1.0 + nodes(8, 2)[..., 0]
    tof = eikonal.solve(speed, 1.0, (3.0, 3.0))
    assert rays.spreading(tof, speed, 1.0, [[3.0, 3.0]], (3.0, 3.0))[0] == 1.0
    assert rays.log_amplitudes(tof, speed, 1.0, [[3.0, 3.0]], (3.0, 3.0))[0] == 0.0


def test_bad_speeds_are_named():
    tof = eikonal.solve(np.ones((8, 8)), 1.0, (3.0, 3.0))
    for ask in (rays.spreading, rays.log_amplitudes):
        with pytest.raises(InvalidInput, match="shape") as refusal:
            ask(tof, np.ones((8, 9)), 1.0, [[3.0, 5.0]], (3.0, 3.0))
        assert refusal.value.field == "speed"

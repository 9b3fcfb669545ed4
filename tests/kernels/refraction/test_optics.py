"""Refraction at one interface: Snell's angle, energy that adds up, and total reflection where it must be."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.arrays import Vector
from bentray_kernels.compilation.compiled import kernel
from bentray_kernels.refraction.optics import reflectances, refracted

from ...effort import effort


@kernel
def bend(direction: Vector, normal: Vector, ratio: float) -> tuple[Vector, float, bool]:
    return refracted(direction, normal, ratio)


@kernel
def mirrored_shares(cosine: float, behind: float, ratio: float) -> tuple[float, float]:
    return reflectances(cosine, behind, ratio)


def unit(seed: int) -> np.ndarray:
    vector = np.random.default_rng(seed).normal(size=3)
    return vector / np.linalg.norm(vector)


@given(seeds=st.tuples(st.integers(0, 10**6), st.integers(0, 10**6)), ratio=st.floats(0.3, 3.0))
@settings(deadline=None, max_examples=effort(20, 300))
def test_snells_law_in_the_plane_of_incidence(seeds, ratio):
    direction, normal = unit(seeds[0]), unit(seeds[1])
    bent, share, passed = bend(tuple(direction), tuple(normal), ratio)
    bent = np.array(bent)
    sine = np.linalg.norm(np.cross(direction, normal))
    assert np.linalg.norm(bent) == pytest.approx(1.0, abs=1e-12)
    # In one plane, and the component along the surface scaled by the ratio.
    np.testing.assert_allclose(
        np.cross(bent, normal), (ratio if passed else 1.0) * np.cross(direction, normal), atol=1e-9
    )
    assert passed == (ratio * sine <= 1.0)
    assert np.sign(bent @ normal) == np.sign(direction @ normal) * (1 if passed else -1)
    assert 0.0 <= share <= 1.0
    if not passed:
        assert share == 1.0
        np.testing.assert_allclose(bent, direction - 2.0 * (direction @ normal) * normal, atol=1e-12)


@given(seed=st.integers(0, 10**6), ratio=st.floats(0.3, 3.0))
@settings(deadline=None)
def test_paths_are_reversible(seed, ratio):
    direction, normal = unit(seed), unit(seed + 1)
    bent, share, passed = bend(tuple(direction), tuple(normal), ratio)
    if passed and abs(np.array(bent) @ normal) > 1e-3:
        back, share_back, _ = bend(tuple(-np.array(bent)), tuple(normal), 1.0 / ratio)
        np.testing.assert_allclose(back, -direction, atol=1e-9)
        assert share_back == pytest.approx(share, abs=1e-9)


@pytest.mark.parametrize("ratio", [1.1, 1.33, 1.5, 2.4])
def test_total_reflection_begins_at_the_critical_angle(ratio):
    for offset, passes in ((-1e-6, True), (1e-6, False)):
        angle = np.arcsin(1.0 / ratio) + offset
        _, _, passed = bend((np.sin(angle), 0.0, np.cos(angle)), (0.0, 0.0, 1.0), ratio)
        assert passed == passes


def test_fresnels_shares_at_known_angles():
    # Glass at right angles: ((1.5 − 1)/(1.5 + 1))²; at Brewster's angle nothing is mirrored in the plane.
    assert mirrored_shares(1.0, 1.0, 1.0 / 1.5) == pytest.approx((0.04, 0.04))
    brewster = np.arctan(1.5)
    s, p = mirrored_shares(np.cos(brewster), np.sin(brewster), 1.0 / 1.5)
    assert p == pytest.approx(0.0, abs=1e-15)
    assert s == pytest.approx(((1.5**2 - 1.0) / (1.5**2 + 1.0)) ** 2)


def test_equal_indices_do_not_refract():
    direction = tuple(unit(7))
    bent, share, passed = bend(direction, tuple(unit(8)), 1.0)
    np.testing.assert_allclose(bent, direction, atol=1e-15)
    assert share == pytest.approx(1.0)
    assert passed

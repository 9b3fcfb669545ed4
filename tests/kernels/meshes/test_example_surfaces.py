"""Surfaces have the faces of Table 5, are closed, and face outward."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.meshes.defects import sound
from bentray_kernels.meshes.example_surfaces import bumpy_ball, sphere, torus

from .examples import volume_of


def test_the_counts_of_table_5():
    assert len(sphere().faces) == 1922
    assert len(torus().faces) == 7938


@given(st.integers(2, 12), st.integers(3, 12))
def test_spheres(rings, around):
    surface = sphere(rings, around)
    assert len(surface.faces) == 2 * around * (rings - 1)
    assert np.linalg.norm(surface.vertices, axis=1) == pytest.approx(1.0)
    checked = sound(surface.vertices, surface.faces)
    assert (checked.genus, checked.holes, checked.turned, checked.merged, checked.unused) == (0, 0, 0, 0, 0)


@given(st.integers(3, 12), st.integers(3, 12), st.floats(0.05, 0.9))
def test_tori(along, around, thickness):
    surface = torus(along, around, thickness)
    checked = sound(surface.vertices, surface.faces)
    assert (checked.genus, checked.holes, checked.turned, checked.merged) == (1, 0, 0, 0)


def test_volumes_come_near_the_true_ones():
    assert volume_of(sphere(100, 200)) == pytest.approx(4 * np.pi / 3, rel=1e-3)
    assert volume_of(torus(200, 100, 0.4)) == pytest.approx(2 * np.pi**2 * 0.16, rel=2e-3)


@pytest.mark.parametrize(("wanted", "made"), [(20, 20), (100, 80), (5000, 5120), (100_000, 100_820)])
def test_balls_have_about_as_many_faces_as_wanted(wanted, made):
    surface = bumpy_ball(wanted)
    assert len(surface.faces) == made
    checked = sound(surface.vertices, surface.faces)
    assert (checked.genus, checked.holes, checked.turned, checked.merged) == (0, 0, 0, 0)


def test_the_bumps_do_not_depend_on_the_faces():
    coarse, fine = bumpy_ball(20 * 8**2), bumpy_ball(20 * 16**2)
    radii = np.linalg.norm(fine.vertices, axis=1)
    assert np.ptp(radii) > 0.2
    shared = {tuple(place) for place in np.round(fine.vertices, 6)}
    assert np.mean([tuple(place) in shared for place in np.round(coarse.vertices, 6)]) > 0.99


@pytest.mark.parametrize(
    "make",
    [
        lambda: sphere(1),
        lambda: sphere(3, 2),
        lambda: torus(2),
        lambda: torus(9, 9, 1.0),
        lambda: bumpy_ball(19),
    ],
)
def test_rejects_unknown_names(make):
    with pytest.raises(InvalidInput):
        make()

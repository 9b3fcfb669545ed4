"""Made surfaces: iso-surfaces and examples are closed, oriented, and where they should be."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from bentray_kernels.errors import InvalidInput
from bentray_kernels.meshes.defects import sound
from bentray_kernels.meshes.example_surfaces import bumpy_ball, sphere, torus
from bentray_kernels.meshes.marching import isosurface_mesh
from bentray_kernels.meshes.pieces import pieces_of
from bentray_kernels.meshes.topology import topology_of

from ...effort import effort
from .examples import volume_of

UNIT = np.ones(3)


def grid(number):
    return np.indices((number,) * 3) - (number - 1) / 2


def test_a_ball():
    surface = isosurface_mesh(8.0 - np.linalg.norm(grid(24), axis=0), np.full(3, 0.5), 0.0)
    radius = np.linalg.norm(surface.vertices - 0.25 * 23, axis=1)
    # Linear interpolation of the distance is short by an eighth of a squared edge over the radius at most.
    np.testing.assert_allclose(radius, 4.0, atol=0.5 * 3 / 8 / 8)
    assert volume_of(surface) == pytest.approx(4 / 3 * np.pi * 64, rel=0.01)
    assert topology_of(surface.faces).genus == 0


def test_a_plane_has_no_error():
    x, y, z = grid(8)
    surface = isosurface_mesh(1.3 * x + 0.4 * y - 0.2 * z, np.array([1.0, 2.0, 3.0]), 0.123)
    position = surface.vertices / (1.0, 2.0, 3.0) - 3.5
    inner = (np.abs(position) < 3.4).all(axis=1)
    assert inner.sum() > 50
    np.testing.assert_allclose(position[inner] @ (1.3, 0.4, -0.2), 0.123, atol=0.02 * 2)
    assert np.median(np.abs(position[inner] @ (1.3, 0.4, -0.2) - 0.123)) < 1e-12


@given(arrays.arrays(np.int8, st.tuples(*(st.integers(2, 5),) * 3), elements=st.integers(0, 2)))
@settings(deadline=None, max_examples=effort(20, 60))
def test_any_volume_gives_closed_surfaces_about_what_is_above(values):
    """Even where values lie on the iso-value and cells touch in corners alone."""
    if values.max() <= 1 or values.min() > 1:
        with pytest.raises(InvalidInput, match="iso: found 1"):
            isosurface_mesh(values, UNIT, 1)
        return
    surface = isosurface_mesh(values, UNIT, 1)
    topology = topology_of(surface.faces)
    assert not topology.on_boundary.any()
    assert topology.fans(~topology.on_boundary).max() + 1 == len(surface.vertices)
    assert volume_of(surface) > 0.0
    assert (np.linalg.norm(surface.face_normals, axis=1) > 0.0).all()


def test_the_torus_has_its_handle_and_two_balls_are_two_pieces():
    x, y, z = grid(20)
    ring = 2.0 - np.hypot(np.hypot(x, y) - 6.0, z)
    assert topology_of(isosurface_mesh(ring, UNIT, 0.0).faces).genus == 1
    balls = np.maximum(4.0 - np.hypot(np.hypot(x - 5.0, y), z), 2.0 - np.hypot(np.hypot(x + 5.0, y), z))
    large, small = (volume_of(piece) for piece in pieces_of(isosurface_mesh(balls, UNIT, 0.0)))
    assert large / small == pytest.approx(8.0, rel=0.2)


def test_what_reaches_the_border_is_closed_there():
    values = np.zeros((6, 7, 8), np.uint8)
    values[:3] = 255
    surface = isosurface_mesh(values, UNIT, 127.5)
    assert not topology_of(surface.faces).on_boundary.any()
    np.testing.assert_allclose(surface.vertices.min(axis=0), 0.0, atol=0.011)
    np.testing.assert_allclose(surface.vertices.max(axis=0), (2.5, 6.0, 7.0), atol=0.011)


@pytest.mark.parametrize("iso", [-1.0, 1.0, 2.0])
def test_an_iso_value_out_of_range_is_rejected(iso):
    values = np.zeros((4, 4, 4))
    values[1, 1, 1] = 1.0
    with pytest.raises(InvalidInput, match=r"accepted: a value in \[0, 1\)"):
        isosurface_mesh(values, UNIT, iso)


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

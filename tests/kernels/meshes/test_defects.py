"""Meshes from files: what can be mended is, what cannot is named."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.meshes.defects import sound
from bentray_kernels.meshes.example_surfaces import sphere, torus
from bentray_kernels.meshes.topology import topology_of

from .examples import ball_with_holes, flat_patch, tetrahedron, two_handles


def volume_of(surface):
    first, second, third = np.moveaxis(surface.corners, 1, 0)
    return (first * np.cross(second, third)).sum() / 6.0


@pytest.mark.parametrize(
    ("surface", "holes", "genus"),
    [
        (sphere(5, 6), 0, 0),
        (torus(6, 5), 0, 1),
        (two_handles(), 0, 2),
        (ball_with_holes(), 2, 0),
        (flat_patch(), 1, 0),
    ],
)
def test_sound_meshes_stay_as_they_are(surface, holes, genus):
    found = sound(surface.vertices, surface.faces)
    assert (found.merged, found.turned, found.holes, found.genus) == (0, 0, holes, genus)
    np.testing.assert_array_equal(found.mesh.corners, surface.corners)
    np.testing.assert_array_equal(found.mesh.vertices, surface.vertices[found.origin])


@given(st.lists(st.booleans(), min_size=60, max_size=60))
def test_faces_are_turned_outward(turned):
    """Whichever faces of a closed surface run the wrong way, the result encloses the same volume."""
    surface = torus(6, 5)
    faces = np.where(np.array(turned)[:, np.newaxis], surface.faces[:, ::-1], surface.faces)
    found = sound(surface.vertices, faces)
    assert found.turned == sum(turned)
    assert volume_of(found.mesh) == pytest.approx(volume_of(surface))


@given(st.sets(st.integers(0, 47), max_size=20))
def test_of_an_open_surface_the_fewest_are_turned(turned):
    surface = flat_patch(7, 5)
    faces = surface.faces.copy()
    faces[sorted(turned)] = faces[sorted(turned)][:, ::-1]
    found = sound(surface.vertices, faces)
    assert found.turned == len(turned)
    assert (found.mesh.face_normals[:, 2] > 0.0).all()


def test_vertices_in_one_place_are_merged_and_those_of_no_face_left_out():
    surface = tetrahedron()
    apart = surface.corners.reshape(-1, 3)
    spare = np.full((2, 3), 9.0)
    found = sound(np.concatenate((apart, spare)), np.arange(12).reshape(-1, 3))
    assert (found.merged, found.unused, len(found.mesh.vertices)) == (8, 2, 4)
    np.testing.assert_array_equal(found.mesh.corners, surface.corners)


def test_fans_that_touch_are_parted():
    """Two holes on opposite sides of one vertex become one hole of six sides."""
    patch = flat_patch(5, 5)
    middle = patch.corners.mean(axis=1)[:, :2]
    about = np.flatnonzero((patch.faces == 12).any(axis=1))
    opposite = np.linalg.norm(middle - (4.0 - middle[about[0]]), axis=1).argmin()
    faces = np.delete(patch.faces, [about[0], opposite], axis=0)
    found = sound(patch.vertices, faces)
    assert (found.parted, found.holes, found.genus, len(found.mesh.vertices)) == (1, 2, 0, 26)
    np.testing.assert_array_equal(found.mesh.corners, patch.vertices[faces])
    np.testing.assert_array_equal(found.mesh.vertices, patch.vertices[found.origin])
    assert [len(loop) for loop in topology_of(found.mesh.faces).boundary_loops] == [16, 6]


def test_zeros_of_either_sign_are_one_place():
    surface = tetrahedron()
    apart = surface.corners.reshape(-1, 3).copy()
    apart[::2] = np.where(apart[::2] == 0.0, -0.0, apart[::2])
    assert sound(apart, np.arange(12).reshape(-1, 3)).merged == 8


STRIP = [(np.cos(a), np.sin(a), 0.0) for a in 2 * np.pi * np.arange(9) / 9] + [
    (1.3 * np.cos(a), 1.3 * np.sin(a), 0.3) for a in 2 * np.pi * np.arange(9) / 9
]


def moebius():
    """A strip that comes back upside down."""
    faces = []
    for k in range(9):
        a, b = (k, k + 9)
        c, d = (k + 1, k + 10) if k < 8 else (9, 0)
        faces += [(a, b, d), (a, d, c)]
    return faces


PLACES = [(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 0, 1), (2, 0, 0), (0, 1, 0)]


@pytest.mark.parametrize(
    ("vertices", "faces", "words"),
    [
        (PLACES, np.empty((0, 3), int), "faces: found none"),
        ([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], [(0, 1, 2)], "vertices: found shape .3, 2."),
        (PLACES, [(0, 1, 2, 3)], "faces: found shape .1, 4."),
        (PLACES, [(0, 1, 8), (0, -1, 2)], "2 corners out of range; accepted: rows 0 to 7"),
        ([(0, 0, np.nan), *PLACES[1:]], [(0, 1, 2)], "vertices: found 1 that are not finite"),
        ([(0, 0, np.inf), *PLACES[1:]], [(0, 1, 2)], "vertices: found 1 that are not finite"),
        (PLACES, [(0, 1, 2), (1, 0, 6)], "1 without area"),
        (PLACES, [(0, 1, 2), (1, 2, 7)], "1 without area"),
        (PLACES, [(0, 1, 2), (1, 0, 3), (0, 1, 4)], "1 edges of three faces or more"),
        (PLACES, [(0, 1, 2), (3, 4, 5)], "2 pieces"),
        (STRIP, moebius(), "cannot be oriented"),
        ([(1e80 * x, y, z) for x, y, z in PLACES], [(0, 1, 2)], "a box of 1e.80"),
        ([(7.0, 7.0, 7.0)] * 3, [(0, 1, 2)], "a box of 0"),
    ],
)
def test_rejects_meshes_that_cannot_be_repaired(vertices, faces, words):
    with pytest.raises(InvalidInput, match=words):
        sound(np.array(vertices), np.array(faces))

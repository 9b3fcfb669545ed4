"""Meshes from files: what can be mended is, what cannot is named."""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.meshes.defects import sound
from bentray_kernels.meshes.example_surfaces import sphere, torus
from bentray_kernels.meshes.mesh import TriangleMesh
from bentray_kernels.meshes.topology import topology_of

from .examples import ball_with_holes, flat_patch, tetrahedron, two_handles, volume_of


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
    repaired = sound(surface.vertices, surface.faces)
    assert (repaired.merged, repaired.turned, repaired.holes, repaired.genus) == (0, 0, holes, genus)
    np.testing.assert_array_equal(repaired.mesh.corners, surface.corners)
    np.testing.assert_array_equal(repaired.mesh.vertices, surface.vertices[repaired.origin])


@given(st.lists(st.booleans(), min_size=60, max_size=60))
def test_faces_are_turned_outward(turned):
    """Whichever faces of a closed surface run the wrong way, the result encloses the same volume."""
    surface = torus(6, 5)
    faces = np.where(np.array(turned)[:, np.newaxis], surface.faces[:, ::-1], surface.faces)
    repaired = sound(surface.vertices, faces)
    assert repaired.turned == sum(turned)
    assert volume_of(repaired.mesh) == pytest.approx(volume_of(surface))


@given(st.sets(st.integers(0, 47), max_size=20))
def test_of_an_open_surface_the_fewest_are_turned(turned):
    surface = flat_patch(7, 5)
    faces = surface.faces.copy()
    faces[sorted(turned)] = faces[sorted(turned)][:, ::-1]
    repaired = sound(surface.vertices, faces)
    assert repaired.turned == len(turned)
    assert (repaired.mesh.face_normals[:, 2] > 0.0).all()


def test_vertices_in_one_place_are_merged_and_those_of_no_face_left_out():
    surface = tetrahedron()
    apart = surface.corners.reshape(-1, 3)
    spare = np.full((2, 3), 9.0)
    repaired = sound(np.concatenate((apart, spare)), np.arange(12).reshape(-1, 3))
    assert (repaired.merged, repaired.unused, len(repaired.mesh.vertices)) == (8, 2, 4)
    np.testing.assert_array_equal(repaired.mesh.corners, surface.corners)


def test_fans_that_touch_are_parted():
    """Two holes on opposite sides of one vertex become one hole of six sides."""
    patch = flat_patch(5, 5)
    middle = patch.corners.mean(axis=1)[:, :2]
    about = np.flatnonzero((patch.faces == 12).any(axis=1))
    opposite = np.linalg.norm(middle - (4.0 - middle[about[0]]), axis=1).argmin()
    faces = np.delete(patch.faces, [about[0], opposite], axis=0)
    repaired = sound(patch.vertices, faces)
    assert (repaired.parted, repaired.holes, repaired.genus, len(repaired.mesh.vertices)) == (1, 2, 0, 26)
    np.testing.assert_array_equal(repaired.mesh.corners, patch.vertices[faces])
    np.testing.assert_array_equal(repaired.mesh.vertices, patch.vertices[repaired.origin])
    assert [len(loop) for loop in topology_of(repaired.mesh.faces).boundary_loops] == [16, 6]


def test_zeros_of_either_sign_are_one_place():
    surface = tetrahedron()
    apart = surface.corners.reshape(-1, 3).copy()
    apart[::2] = np.where(apart[::2] == 0.0, -0.0, apart[::2])
    assert sound(apart, np.arange(12).reshape(-1, 3)).merged == 8


BALL = sphere(9, 8)


def same_surface(repaired, surface):
    """Closed, with the same area and volume, and without flat faces."""
    areas = [np.linalg.norm(mesh.face_normals, axis=1) for mesh in (repaired.mesh, surface)]
    assert areas[0].min() > 1e-6 * areas[1].min()
    assert areas[0].sum() == pytest.approx(areas[1].sum(), rel=1e-4)
    assert volume_of(repaired.mesh) == pytest.approx(volume_of(surface), rel=1e-4)
    assert (repaired.holes, repaired.genus) == (0, 0)


def with_junctions(surface, divided, parts):
    """One side of each of these faces divided; faces on a line close the gaps, as in files of CAD."""
    vertices, faces = surface.vertices.tolist(), surface.faces.tolist()
    for face in divided:
        a, b, c = faces[face]
        share = np.linspace(0.0, 1.0, parts + 1)[1:-1, np.newaxis]
        inner = (1.0 - share) * surface.vertices[a] + share * surface.vertices[b]
        chain = [a, *range(len(vertices), len(vertices) + parts - 1), b]
        vertices += inner.tolist()
        faces[face] = [chain[0], chain[1], c]
        faces += [[chain[k], chain[k + 1], c] for k in range(1, parts)]
        faces += [[chain[k + 1], chain[k], b] for k in range(parts - 1)]
    return np.array(vertices), np.array(faces)


@pytest.mark.parametrize("parts", [2, 3, 7])
def test_faces_on_a_line_are_given_to_their_neighbours(parts):
    """Without a gap: the neighbour across the longest side is divided."""
    repaired = sound(*with_junctions(BALL, (3, 20, 41), parts))
    assert repaired.flat == 3 * (parts - 1)
    same_surface(repaired, BALL)


def test_a_face_on_a_line_beside_an_open_side_is_left_out():
    repaired = sound(np.array(PLACES), np.array([(0, 1, 2), (1, 0, 6)]))
    assert (repaired.flat, len(repaired.mesh.faces), repaired.holes) == (1, 1, 1)


def rounded(scale, digits=None, noise=0.0):
    """Triangles with corners of their own that agree to some digits only, as in STL."""
    corners = scale * BALL.corners
    corners *= 1.0 + np.random.default_rng(0).uniform(-noise, noise, corners.shape)
    if digits is not None:
        corners = np.vectorize(lambda value: float(f"{value:.{digits}g}"))(corners)
    return corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3)


@pytest.mark.parametrize(
    ("scale", "digits", "noise"),
    [
        (1.0, None, 1e-12),
        (37.5, None, 3e-7),
        (5e-2, None, 1e-6),
        (37.5, 7, 1e-7),
        (1.0, 6, 1e-7),
        (2e-3, 6, 1e-6),
    ],
)
def test_corners_that_agree_to_the_digits_of_a_file_are_merged(scale, digits, noise):
    repaired = sound(*rounded(scale, digits, noise))
    assert repaired.merged == 3 * len(BALL.faces) - len(BALL.vertices)
    same_surface(repaired, TriangleMesh(scale * BALL.vertices, BALL.faces))


def test_corners_farther_apart_are_named_with_their_distance():
    with pytest.raises(
        InvalidInput, match=r"pieces that share no edges, their nearest corners \S+ apart.*merge"
    ):
        sound(*rounded(1.0, noise=1e-3))


@pytest.mark.parametrize("gap", [1e-3, 1e-2])
def test_a_slit_stays_open(gap):
    """Only rounding is closed."""
    patch = flat_patch(5, 5)
    right = patch.corners.mean(axis=1)[:, 0] > patch.vertices[12, 0]
    moved = patch.vertices + np.outer(np.arange(25) == 12, [gap, 0.0, 0.0])
    faces = np.where(right[:, np.newaxis], patch.faces + 25, patch.faces)
    repaired = sound(np.concatenate((patch.vertices, moved)), faces)
    assert (repaired.holes, repaired.merged, repaired.genus) == (2, 4, 0)


DEFECTS = {
    "a vertex twice": (lambda v, f: (v, [*f, (0, 0, 1)]), {"flat": 1}),
    "one vertex": (lambda v, f: (v, [*f, (5, 5, 5)]), {"flat": 1}),
    "at one place": (
        lambda v, f: ([*v, v[f[0][0]]], [*f, (f[0][0], len(v), f[0][1])]),
        {"flat": 1, "merged": 1},
    ),
    "nearly at one place": (
        lambda v, f: ([*v, v[f[0][0]] + 1e-12], [*f, (f[0][0], len(v), f[0][1])]),
        {"flat": 1},
    ),
    "a hair on an edge": (
        lambda v, f: ([*v, 0.5 * (v[f[0][0]] + v[f[0][1]])], [*f, (f[0][0], len(v), f[0][1])]),
        {"flat": 1},
    ),
    "a face twice": (lambda v, f: (v, [*f, f[0]]), {"repeated": 1}),
    "a face three times, turned": (lambda v, f: (v, [*f, np.roll(f[0], 1), f[0][::-1]]), {"repeated": 2}),
    "both sides": (lambda v, f: (v, [*f, *f[:, ::-1]]), {"repeated": len(BALL.faces)}),
    "all of it twice": (
        lambda v, f: ([*v, *v], [*f, *(f + len(v))]),
        {"repeated": len(BALL.faces), "merged": len(BALL.vertices)},
    ),
    "NaN of no face": (lambda v, f: ([*v, (np.nan, 0.0, 0.0)], f), {"unused": 1}),
    "in mm": (lambda v, f: (1e3 * v, f), {}),
    "turned": (lambda v, f: (v, [*f[:9, ::-1], *f[9:]]), {"turned": 9}),
}


@pytest.mark.parametrize("defect", DEFECTS)
def test_defects_with_one_repair_are_repaired_and_counted(defect):
    spoil, repairs = DEFECTS[defect]
    vertices, faces = (np.asarray(array) for array in spoil(BALL.vertices, BALL.faces))
    repaired = sound(vertices, faces)
    names = ("merged", "unused", "flat", "repeated", "turned", "parted")
    assert {name: getattr(repaired, name) for name in names} == dict.fromkeys(names, 0) | repairs
    assert (len(repaired.mesh.faces), len(repaired.mesh.vertices)) == (len(BALL.faces), len(BALL.vertices))
    np.testing.assert_array_equal(repaired.mesh.vertices, vertices[repaired.origin])
    scale = np.ptp(repaired.mesh.vertices) / np.ptp(BALL.vertices)
    same_surface(repaired, TriangleMesh(scale * BALL.vertices, BALL.faces))


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
        ([*PLACES[:2], (0, 0, np.nan)], [(0, 1, 2)], "1 that are not finite, the first number 2"),
        ([(0, 0, np.inf), *PLACES[1:]], [(0, 1, 2)], "1 that are not finite, the first number 0"),
        (PLACES, [(0, 1, 6)], "1 without area, the first between the vertices 0, 1, 6"),
        (PLACES, [(0, 1, 1), (2, 7, 3)], "2 without area and no other"),
        (PLACES, [(0, 1, 2), (1, 0, 3), (0, 1, 4)], r"1 edges of three.*from vertex 0 \(0, 0, 0\) to 1"),
        (PLACES, [(0, 1, 2), (3, 4, 5)], "2 pieces that share no edges, their nearest corners 1 apart"),
        (STRIP, moebius(), "cannot be oriented"),
        ([(1e80 * x, y, z) for x, y, z in PLACES], [(0, 1, 2)], "a box of 1e.80"),
        ([(7.0, 7.0, 7.0)] * 3, [(0, 1, 2)], "a box of 0"),
    ],
)
def test_rejects_meshes_that_cannot_be_repaired(vertices, faces, words):
    with pytest.raises(InvalidInput, match=words):
        sound(np.array(vertices), np.array(faces))


def test_reading_a_mesh_does_not_import_libigl():
    program = "import sys; from bentray_kernels.meshes.defects import sound; sys.exit('igl' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0

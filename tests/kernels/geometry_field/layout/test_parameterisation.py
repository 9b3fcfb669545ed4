"""Charts: every face once, none flipped, none over another, angles kept."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.geometry_field.layout.distortion import crosses_itself, signed_areas
from bentray_kernels.geometry_field.layout.parameterisation import parameterise
from bentray_kernels.meshes.defects import sound
from bentray_kernels.meshes.example_surfaces import bumpy_ball, torus
from bentray_kernels.meshes.opening import cut_open
from bentray_kernels.meshes.pieces import pieces_of
from bentray_kernels.meshes.topology import topology_of

from ...meshes.examples import SURFACES as EVERY_SURFACE
from ...meshes.examples import bunny, flat_patch, mesh, tetrahedron


def check(made, surface):
    """Every chart is an embedding of the whole surface in the unit square."""
    uv = made.chart.uv
    assert uv.shape == (len(surface.faces), 3, 2)
    assert uv.min() >= 0.0
    assert uv.max() <= 1.0
    assert (signed_areas(uv) > 0.0).all()
    opened = cut_open(topology_of(surface.faces), made.cut)
    flat = np.full((len(opened.origin), 2), np.nan)
    flat[opened.faces] = uv
    # Corners that were not cut apart share a place.
    np.testing.assert_array_equal(flat[opened.faces], uv)
    (loop,) = topology_of(opened.faces).boundary_loops
    assert not crosses_itself(flat[opened.faces.ravel()[loop]])
    assert np.ptp(made.chart.mesh.vertices[np.unique(surface.faces)], axis=0).max() == pytest.approx(1.0)


SURFACES = EVERY_SURFACE | {
    "tetrahedron": tetrahedron(),
    "triangle": mesh(np.eye(3), [(0, 1, 2)]),
}


@pytest.mark.parametrize("name", SURFACES)
def test_surfaces_of_every_kind(name):
    layout = parameterise(SURFACES[name])
    check(layout, SURFACES[name])
    assert layout.conformal
    assert layout.area_stretch < 4.0


@pytest.mark.parametrize(
    ("name", "most"), [("sphere", 1.06), ("torus", 1.07), ("ball", 1.06), ("patch", 1.03)]
)
def test_angles_are_kept(name, most):
    assert np.median(parameterise(SURFACES[name]).quasi_conformal) < most


def test_a_flat_square_fills_the_image_uncut():
    layout = parameterise(flat_patch(9, 9))
    assert not layout.cut.any()
    assert layout.area_stretch == pytest.approx(1.0, rel=1e-6)
    np.testing.assert_allclose(layout.quasi_conformal, 1.0, atol=1e-6)


@given(st.integers(0, 1000), st.floats(0.0, 0.04))
@settings(deadline=None, max_examples=15)
def test_noise_flips_nothing(seed, height):
    ball = bumpy_ball(1000)
    noise = np.random.default_rng(seed).normal(0.0, height, ball.vertices.shape)
    surface = mesh(ball.vertices + noise, ball.faces)
    check(parameterise(surface), surface)


@pytest.mark.parametrize("seed", range(15))
def test_ragged_surfaces(seed):
    """Surfaces that lost faces at random: many holes side by side."""
    random = np.random.default_rng(seed)
    whole = (torus(8, 6), bumpy_ball(500), torus(20, 12))[seed % 3]
    left = mesh(whole.vertices, whole.faces[random.uniform(size=len(whole.faces)) < 0.6 + 0.025 * seed])
    piece = pieces_of(left)[0]
    surface = sound(piece.vertices, piece.faces).mesh
    check(parameterise(surface), surface)


def test_two_faces_back_to_back():
    pillow = mesh(np.eye(3), [(0, 1, 2), (0, 2, 1)])
    check(parameterise(pillow), pillow)


def test_needles_get_a_layout_that_reports_its_distortion():
    ball = bumpy_ball(3000)
    needles = mesh(ball.vertices * (1.0, 1.0, 80.0), ball.faces)
    layout = parameterise(needles)
    check(layout, needles)
    assert not layout.conformal


def test_size_place_and_unit_do_not_matter():
    ball = bumpy_ball(1000)
    moved = mesh(1e-3 * ball.vertices + (5.0, 6.0, 7.0), ball.faces)
    np.testing.assert_allclose(parameterise(moved).chart.uv, parameterise(ball).chart.uv, atol=1e-6)


@pytest.mark.parametrize(
    ("faces", "words"),
    [
        ([(0, 1, 2), (3, 4, 5)], "2 pieces"),
        ([(0, 1, 2), (1, 0, 3), (0, 1, 4)], "three faces"),
        ([(0, 1, 2), (0, 1, 3)], "run alike"),
        ([(0, 1, 2), (1, 0, 6)], "1 without area"),
    ],
)
def test_other_meshes_are_rejected(faces, words):
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 0, 1), (2, 0, 0)]
    with pytest.raises(InvalidInput, match=words):
        parameterise(mesh(points, faces))


def test_touching_fans_are_rejected():
    patch = flat_patch(4, 4)
    # The faces of one side of the patch with those of the other meet in a vertex alone.
    kept = patch.faces[np.isin(np.arange(18), [0, 9, 8, 16, 17, 7, 15])]
    with pytest.raises(InvalidInput, match=r"pieces|fans"):
        parameterise(mesh(patch.vertices, kept))


@pytest.mark.real
@pytest.mark.nightly
def test_bunny():
    surface = bunny()
    layout = parameterise(surface)
    check(layout, surface)
    assert layout.conformal
    assert np.median(layout.quasi_conformal) < 1.02
    assert layout.area_stretch < 3.0

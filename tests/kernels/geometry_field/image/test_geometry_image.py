"""Geometry images hold the surface: pixels, topology, and as few pixels as the error allows."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.geometry_field.image.geometry_image import geometry_image
from bentray_kernels.geometry_field.image.raster import INSIDE, OUTSIDE, SEAM, rasterised, seam_sides
from bentray_kernels.geometry_field.image.subsampling import fitted_image
from bentray_kernels.geometry_field.layout.parameterisation import parameterise
from bentray_kernels.meshes.example_surfaces import bumpy_ball, sphere, torus
from bentray_kernels.meshes.geometric_error import geometric_error
from bentray_kernels.meshes.mesh import Chart
from bentray_kernels.meshes.surface_distance import SurfaceGrid
from bentray_kernels.meshes.topology import topology_of

from ...meshes.examples import SURFACES, bunny, flat_patch, mesh, volume_of


@pytest.fixture(scope="module")
def bumpy():
    return parameterise(bumpy_ball(5000)).chart


def test_positions_lie_on_the_surface(bumpy):
    image = geometry_image(bumpy, 100)
    assert image.size == 100
    assert image.positions.shape == image.normals.shape == (100, 100, 3)
    assert SurfaceGrid(bumpy.mesh).distance(image.positions[image.valid]).max() < 1e-12
    assert (image.positions[~image.valid] == 0.0).all()
    np.testing.assert_array_equal(image.valid, image.raster.kind != OUTSIDE)
    assert 0.4 < (image.raster.kind == INSIDE).mean() < 0.8


def test_normals_of_a_sphere_point_away_from_its_middle():
    image = geometry_image(parameterise(sphere(60, 60)).chart, 64)
    outward = (image.positions - 0.5)[image.valid]
    outward /= np.linalg.norm(outward, axis=-1, keepdims=True)
    normals = image.normals[image.valid]
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1.0)
    assert (normals * outward).sum(axis=-1).min() > 0.998


def test_colours_are_read_where_the_positions_are(bumpy):
    image = geometry_image(bumpy, 64)
    np.testing.assert_allclose(image.sampled(bumpy.mesh.vertices), image.positions, atol=1e-12)
    assert image.sampled(np.ones((len(bumpy.mesh.vertices), 1)))[image.valid] == pytest.approx(1.0)


def test_the_error_falls_with_the_pixels(bumpy):
    errors = [
        geometric_error(bumpy.mesh, geometry_image(bumpy, size).mesh(), 10_000) for size in (65, 129, 257)
    ]
    # Twice the pixels, a quarter of the error, as long as a pixel is larger than a face.
    assert errors[0].rms / errors[1].rms > 2.5
    assert errors[1].rms / errors[2].rms > 1.8
    assert errors[2].greatest < 5e-3


@pytest.mark.real
@pytest.mark.nightly
def test_bunny():
    chart = parameterise(bunny()).chart
    error = geometric_error(chart.mesh, geometry_image(chart, 512).mesh(), 20_000)
    assert error.rms < 3.2e-4


@pytest.fixture(scope="module")
def chart():
    return parameterise(bumpy_ball(2000)).chart


def test_the_smallest_image_within_the_threshold(chart):
    fitted = fitted_image(chart, 4e-3, finest=129, coarsest=9, samples=5000)
    sizes, errors = zip(*((size, error.rms) for size, error in fitted.tried), strict=True)
    assert sizes == (129, 65, 33, 17, 9)[: len(sizes)]
    assert len(sizes) > 2
    assert errors[-1] > 4e-3 >= errors[-2]
    assert (fitted.image.size, fitted.error.rms) == (sizes[-2], errors[-2])
    assert list(errors) == sorted(errors)


def test_it_stops_at_the_coarsest(chart):
    fitted = fitted_image(chart, 1.0, finest=65, coarsest=33, samples=1000)
    assert [size for size, _ in fitted.tried] == [65, 33]
    assert fitted.image.size == 33


def test_a_threshold_that_cannot_be_reached_is_rejected(chart):
    with pytest.raises(InvalidInput, match=r"threshold: found 1e-06, where 33² pixels have"):
        fitted_image(chart, 1e-6, finest=33, samples=1000)


def test_every_second_pixel_is_kept(chart):
    fine, coarse = geometry_image(chart, 65), geometry_image(chart, 33)
    inside = coarse.raster.kind == INSIDE
    np.testing.assert_array_equal(inside, fine.raster.kind[::2, ::2] == INSIDE)
    np.testing.assert_allclose(coarse.positions[inside], fine.positions[::2, ::2][inside], atol=1e-12)


@pytest.mark.parametrize("size", [65, 128])
@pytest.mark.parametrize("name", SURFACES)
def test_topology_comes_back(name, size):
    surface = SURFACES[name]
    chart = parameterise(surface).chart
    before, mesh = topology_of(surface.faces), geometry_image(chart, size).mesh()
    after = topology_of(mesh.faces)
    assert (after.genus, len(after.boundary_loops), after.pieces.max()) == (
        before.genus,
        len(before.boundary_loops),
        0,
    )
    # No two fans touch.
    assert after.fans(~after.on_boundary).max() + 1 == len(mesh.vertices)
    if not before.on_boundary.any():
        assert volume_of(mesh) == pytest.approx(volume_of(chart.mesh), rel=0.05)


def test_the_boundary_of_a_patch_is_kept_whole():
    chart = parameterise(SURFACES["patch"]).chart
    mesh = geometry_image(chart, 64).mesh()

    def rim(surface):
        topology = topology_of(surface.faces)
        return np.linalg.norm(
            np.diff(surface.vertices[topology.edges[topology.on_boundary]], axis=1), axis=-1
        ).sum()

    assert rim(mesh) == pytest.approx(rim(chart.mesh), rel=1e-9)


def test_a_flat_square_comes_back_as_a_square():
    chart = parameterise(flat_patch(5, 5)).chart
    mesh = geometry_image(chart, 16).mesh()
    assert np.linalg.norm(mesh.face_normals, axis=1).sum() == pytest.approx(1.0, rel=1e-9)
    assert geometric_error(chart.mesh, mesh, 1000).greatest < 1e-12


def flat_chart(patch, turn=0.0):
    """A flat patch laid out as it is, a little turned about its middle."""
    size = np.ptp(patch.vertices[:, :2], axis=0).max()
    c, s = np.cos(turn), np.sin(turn)
    points = (patch.vertices[:, :2] / size - 0.5) @ np.array([(c, s), (-s, c)]) / (abs(c) + abs(s)) + 0.5
    return Chart(patch, points[patch.faces])


@given(st.floats(-0.7, 0.7), st.integers(8, 40))
def test_inside_the_values_are_those_of_the_place(turn, size):
    chart = flat_chart(flat_patch(6, 6), turn)
    raster = rasterised(chart, size)
    # The layout is linear: so is what is read from it.
    points = raster.sampled(chart.uv)
    lattice = np.stack(np.meshgrid(*(np.arange(size),) * 2, indexing="ij"), axis=-1) / (size - 1)
    inside = raster.kind == INSIDE
    np.testing.assert_allclose(points[inside], lattice[inside], atol=1e-9)
    # Next to the boundary a pixel stands for the nearest point of it.
    seam = raster.kind == SEAM
    steps = np.linalg.norm(points[seam] - lattice[seam], axis=-1) * (size - 1)
    assert (steps <= 1.5 + 1e-9).all()
    np.testing.assert_allclose(raster.weights[raster.kind != OUTSIDE].sum(axis=-1), 1.0)
    assert (raster.face[raster.kind == OUTSIDE] == -1).all()
    corners = raster.kind != OUTSIDE
    whole = corners[:-1, :-1] & corners[1:, :-1] & corners[:-1, 1:] & corners[1:, 1:]
    assert (whole | ~raster.cells).all()


def test_a_square_fills_every_pixel():
    raster = rasterised(flat_chart(flat_patch(5, 5)), 17)
    assert (raster.kind == INSIDE).all()
    assert raster.cells.all()


def test_seam_points_lie_on_both_sides_of_the_cut():
    """A pixel by the seam stands for a point of an edge that is cut, or lies on the boundary."""
    layout = parameterise(torus(20, 16))
    raster = rasterised(layout.chart, 64)
    rows = np.flatnonzero((raster.kind == SEAM).ravel())
    weights = raster.weights.reshape(-1, 3)[rows]
    assert (np.sort(weights, axis=1)[:, 0] == 0.0).all()
    assert len(seam_sides(layout.chart)) == 2 * layout.cut.sum()


def test_the_sides_of_an_open_patch_are_its_seam():
    chart = flat_chart(flat_patch(4, 3))
    assert len(seam_sides(chart)) == 10


def test_a_small_image_is_rejected_and_a_flipped_face_is_left_out():
    chart = flat_chart(flat_patch(4, 4))
    with pytest.raises(InvalidInput, match="size: found 7"):
        rasterised(chart, 7)
    flipped = Chart(mesh(np.eye(3), [(0, 1, 2)]), np.array([[(0.0, 0.0), (0.0, 1.0), (1.0, 0.0)]]))
    assert (rasterised(flipped, 9).kind != INSIDE).all()

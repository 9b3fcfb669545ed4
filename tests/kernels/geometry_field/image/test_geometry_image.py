"""Geometry images hold the surface: the finer, the nearer."""

import numpy as np
import pytest

from bentray_kernels.geometry_field.image.geometry_image import geometry_image
from bentray_kernels.geometry_field.image.raster import INSIDE, OUTSIDE
from bentray_kernels.geometry_field.layout.parameterisation import parameterise
from bentray_kernels.meshes.example_surfaces import bumpy_ball, sphere
from bentray_kernels.meshes.geometric_error import geometric_error
from bentray_kernels.meshes.surface_distance import SurfaceGrid

from ...meshes.examples import bunny


@pytest.fixture(scope="module")
def ball():
    return parameterise(bumpy_ball(5000)).chart


def test_positions_lie_on_the_surface(ball):
    image = geometry_image(ball, 100)
    assert image.size == 100
    assert image.positions.shape == image.normals.shape == (100, 100, 3)
    assert SurfaceGrid(ball.mesh).distance(image.positions[image.valid]).max() < 1e-12
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


def test_colours_are_read_where_the_positions_are(ball):
    image = geometry_image(ball, 64)
    np.testing.assert_allclose(image.sampled(ball.mesh.vertices), image.positions, atol=1e-12)
    assert image.sampled(np.ones((len(ball.mesh.vertices), 1)))[image.valid] == pytest.approx(1.0)


def test_the_error_falls_with_the_pixels(ball):
    errors = [
        geometric_error(ball.mesh, geometry_image(ball, size).mesh(), 10_000) for size in (65, 129, 257)
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

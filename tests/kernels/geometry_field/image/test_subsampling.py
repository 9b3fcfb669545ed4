"""Images shrink as far as the error allows."""

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.geometry_field.image.geometry_image import geometry_image
from bentray_kernels.geometry_field.image.raster import INSIDE
from bentray_kernels.geometry_field.image.subsampling import fitted_image
from bentray_kernels.geometry_field.layout.parameterisation import parameterise
from bentray_kernels.meshes.example_surfaces import bumpy_ball


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

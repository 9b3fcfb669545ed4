"""Errors and similarity of images, against their definitions written out node by node."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import correlation, mean_absolute_error, rmse, structural_similarity


def pair(shape: tuple[int, ...] = (14, 12)) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(3)
    truth = random.normal(1500.0, 30.0, shape)
    return truth + random.normal(5.0, 20.0, shape), truth


def by_definition(image: np.ndarray, truth: np.ndarray, region: np.ndarray, value_range: float) -> float:
    """Equation 13 of Wang et al. 2004 with uniform windows of 7 x 7 nodes and sample covariances."""
    c1, c2 = (0.01 * value_range) ** 2, (0.03 * value_range) ** 2
    results = []
    for i in range(3, image.shape[0] - 3):
        for j in range(3, image.shape[1] - 3):
            window = np.s_[i - 3 : i + 4, j - 3 : j + 4]
            if not region[window].all():
                continue
            x, y = image[window].ravel(), truth[window].ravel()
            (xx, xy), (_, yy) = np.cov(x, y)
            results.append(
                (2 * x.mean() * y.mean() + c1)
                * (2 * xy + c2)
                / ((x.mean() ** 2 + y.mean() ** 2 + c1) * (xx + yy + c2))
            )
    return float(np.mean(results))


def test_similarity_is_that_of_its_definition_in_windows_inside_the_region() -> None:
    image, truth = pair()
    for region in (np.ones(image.shape, bool), np.indices(image.shape).sum(0) > 3):
        expected = by_definition(image, truth, region, 150.0)
        assert structural_similarity(image, truth, region, 150.0) == pytest.approx(expected, rel=1e-9)
    spoilt = image.copy()
    spoilt[0, 0] = np.nan
    assert structural_similarity(spoilt, truth, region, 150.0) == pytest.approx(expected, rel=1e-9)


def test_similarity_equals_that_of_scikit_image() -> None:
    """``skimage.metrics.structural_similarity(truth, image, data_range=150)`` of scikit-image 0.26."""
    image, truth = pair()
    everywhere = np.ones(image.shape, bool)
    similarity = structural_similarity(image, truth, everywhere, 150.0)
    assert similarity == pytest.approx(0.8304962059667472, rel=1e-9)


def test_similarity_of_a_volume_is_the_mean_over_its_slices() -> None:
    image, truth = pair((9, 10, 2))
    region = np.ones(image.shape, bool)
    slices = [by_definition(image[..., k], truth[..., k], region[..., k], 80.0) for k in (0, 1)]
    assert structural_similarity(image, truth, region, 80.0) == pytest.approx(np.mean(slices), rel=1e-9)


def test_equal_images_are_similar_and_small_regions_have_no_window() -> None:
    _, truth = pair()
    region = np.ones(truth.shape, bool)
    assert structural_similarity(truth, truth, region, 1.0) == pytest.approx(1.0)
    region[6] = False
    region[:, 5] = False
    assert math.isnan(structural_similarity(truth, truth, region, 1.0))


@given(st.floats(0.1, 10.0), st.floats(-50.0, 50.0))
def test_correlation_ignores_scale_and_offset(scale: float, offset: float) -> None:
    image, truth = pair((4, 5))
    region = np.arange(20).reshape(4, 5) != 7
    expected = np.corrcoef(image[region], truth[region])[0, 1]
    assert correlation(scale * image + offset, truth, region) == pytest.approx(expected)
    assert correlation(-image, truth, region) == pytest.approx(-expected)


def test_errors_are_those_of_the_nodes_in_the_region() -> None:
    image, truth = np.array([[3.0, 1.0, 900.0]]), np.array([[0.0, 5.0, 0.0]])
    region = np.array([[True, True, False]])
    assert mean_absolute_error(image, truth, region) == 3.5
    assert mean_absolute_error(image, truth, region, 7.0) == 0.5
    assert rmse(image, truth, region) == pytest.approx(math.sqrt(12.5))
    assert math.isnan(correlation(image * 0.0, truth, region))


@pytest.mark.parametrize("measure", [rmse, correlation, mean_absolute_error])
def test_bad_input_is_named(measure: object) -> None:
    flat = np.ones((2, 2))
    for region in (np.zeros((2, 2), bool), np.ones(2, bool)):
        with pytest.raises(InvalidInput, match="region"):
            measure(flat, flat, region)  # type: ignore[operator]
    for call in (structural_similarity, mean_absolute_error):
        with pytest.raises(InvalidInput, match="value_range"):
            call(flat, flat, flat > 0, 0.0)

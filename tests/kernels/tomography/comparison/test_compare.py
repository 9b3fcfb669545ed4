"""Errors against a truth: definitions, the region they are read in, the truth on the nodes of an image."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.acquisition import Truth
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import (
    Reconstruction,
    correlation,
    mean_absolute_error,
    rmse,
    structural_similarity,
)
from bentray_kernels.tomography.comparison import NotComparable, compare, on_grid

from .squares import STEP, WATER, disc, image, truth


@given(st.floats(-40.0, 40.0))
def test_a_constant_error_is_read_as_it_is(offset: float) -> None:
    comparison = compare(image(disc() + offset), truth(disc()))
    assert comparison.rms == pytest.approx(abs(offset), abs=1e-9)
    assert comparison.mean_absolute_of_range == pytest.approx(abs(offset) / 100.0, abs=1e-9)
    assert comparison.range == (1450.0, 1550.0)
    assert comparison.region.sum() == 81


def test_statistics_have_the_uncertainty_of_the_nodes_in_the_region() -> None:
    speed = np.where(disc() == WATER, 90.0, 4.0)
    comparison = compare(
        replace(image(disc() + 2.0), uncertainty=speed, resolution_width_m=(3e-3,)), truth(disc())
    )
    image_there, true_there = comparison.statistics()
    assert image_there.uncertainty == pytest.approx(4.0)
    assert true_there.uncertainty is None
    assert image_there.mean - true_there.mean == pytest.approx(2.0)
    assert comparison.mean_absolute == pytest.approx(2.0)
    assert comparison.correlation == pytest.approx(1.0)


def test_errors_in_the_water_do_not_count() -> None:
    speed = disc()
    speed[0, 0] += 500.0
    assert compare(image(speed), truth(disc())).rms == 0.0


def test_the_outline_holds_what_it_encloses_in_each_slice() -> None:
    ring = disc()
    ring[7:10, 7:10] = WATER
    assert compare(image(disc()), truth(ring)).region.sum() == 81
    # A tube: what it encloses in its slices is open at both ends of the volume.
    solid = np.stack([ring, ring, np.full((17, 17), WATER)], axis=-1)
    region = compare(image(solid, (0.0,) * 3), truth(solid)).region
    assert region.sum(axis=(0, 1)).tolist() == [81, 81, 0]


def test_the_region_of_the_file_is_used_and_named() -> None:
    roi = np.zeros((17, 17), dtype=bool)
    roi[0:2, 0:2] = True
    comparison = compare(image(disc() + 3.0), truth(disc()), roi)
    assert comparison.region_choice == "mask/roi of the file"
    assert comparison.region.sum() == 4
    assert comparison.mean_absolute_of_range is None, "water alone has no range to divide by"
    assert comparison.rms == pytest.approx(3.0)
    assert comparison.caption() == "3.0 m/s rms"


def test_a_region_wider_than_the_outline_brings_in_what_equals_the_water() -> None:
    """Fat as fast as the water: the outline misses it, and with it the error that is made there."""
    roi = np.zeros((17, 17), dtype=bool)
    roi[2:15, 2:15] = True
    speed = disc()
    speed[2, 2:15] += 30.0
    assert compare(image(speed), truth(disc())).rms == 0.0
    wide = compare(image(speed), truth(disc()), roi)
    assert wide.rms == pytest.approx(30.0 / math.sqrt(13.0))
    assert wide.caption() == f"{100 * 0.3 / 13:.1f} % of range, {30 / math.sqrt(13):.1f} m/s rms"


@pytest.mark.parametrize("roi", [np.zeros((17, 17), bool), np.ones((3, 3), bool)])
def test_a_region_that_marks_nothing_or_lies_on_another_grid_is_not_used(roi: np.ndarray) -> None:
    comparison = compare(image(disc()), truth(disc()), roi)
    assert comparison.region_choice == "the outline of what is not water in the truth"


def test_a_truth_that_is_water_throughout_is_compared_everywhere() -> None:
    comparison = compare(image(np.full((17, 17), WATER + 2.0)), truth(np.full((17, 17), WATER)))
    assert comparison.region_choice == "every node that the truth covers"
    assert comparison.region.all()


def test_x_and_y_are_not_exchanged() -> None:
    assert compare(image(disc().T), truth(disc())).rms > 10.0
    assert compare(image(disc()), replace(truth(disc().T), axes="y,x")).rms == 0.0


def test_several_slices_are_compared_with_a_solid_known() -> None:
    solid = np.stack([disc(), np.full((17, 17), WATER), disc()[::-1]], axis=-1)
    assert compare(image(solid + 2.0, (0.0,) * 3), truth(solid)).rms == pytest.approx(2.0)
    assert compare(image(solid[..., ::-1], (0.0,) * 3), truth(solid)).rms > 10.0


def test_truth_outside_the_image_is_not_comparable() -> None:
    with pytest.raises(NotComparable, match="no node of the image lies within the truth"):
        compare(image(disc(), origin=(1.0, 1.0)), truth(disc()))


SPACING_M = 2e-3


def known(axes: str = "x,y") -> Truth:
    return replace(truth(disc()), axes=axes)


def made(slices: int | None = None) -> Reconstruction:
    """An image of the nodes of the truth; slices are at uneven heights."""
    if slices is None:
        return image(disc())
    solid = image(np.full((24, 24, slices), WATER), (0.0,) * 3)
    return replace(solid, spacing_m=(STEP, STEP, np.nan))


def speed_on_grid(truth: Truth, result: Reconstruction) -> np.ndarray:
    return on_grid(truth.sound_speed_mps, truth, result)


def test_on_the_same_grid_the_truth_is_itself():
    np.testing.assert_allclose(speed_on_grid(known(), made()), known().sound_speed_mps)


def test_a_ramp_is_read_between_its_nodes_and_missing_beyond_them():
    x, y = np.meshgrid(np.linspace(-0.01, 0.01, 7), np.linspace(-0.02, 0.02, 9), indexing="ij")
    ramp = Truth(1500.0 + 1e3 * x - 2e3 * y, (0.02 / 6, 0.005), (-0.01, -0.02))
    result = replace(image(np.full((24, 24), WATER), (-0.023, -0.023)), spacing_m=(SPACING_M, SPACING_M))
    position = result.origin_m[0] + SPACING_M * np.arange(24)
    expected = 1500.0 + 1e3 * position[:, None] - 2e3 * position[None, :]
    inside = (np.abs(position) <= 0.01)[:, None] & (np.abs(position) <= 0.02)[None, :]
    computed = speed_on_grid(ramp, result)
    np.testing.assert_allclose(computed[inside], expected[inside])
    assert np.isnan(computed[~inside]).all()


def test_axes_are_brought_to_x_and_y():
    plain = known()
    turned = replace(plain, sound_speed_mps=plain.sound_speed_mps.T.copy(), axes="y,x")
    np.testing.assert_array_equal(speed_on_grid(turned, made()), speed_on_grid(plain, made()))
    assert not np.array_equal(turned.sound_speed_mps, plain.sound_speed_mps)


def test_a_volume_is_read_at_each_slice():
    volume = Truth(
        np.full((3, 3, 3), 1500.0) + 10.0 * np.arange(3), (0.1, 0.1, 0.01), (-0.1, -0.1, 0.0), axes="x,y,z"
    )
    result = replace(made(slices=2), spacing_m=(SPACING_M, SPACING_M, 0.01), origin_m=(-0.02, -0.02, 0.005))
    results = speed_on_grid(volume, result)
    assert results.shape == result.speed.shape
    np.testing.assert_allclose(results[..., 0], 1505.0)
    np.testing.assert_allclose(results[..., 1], 1515.0)


def solid() -> Truth:
    return Truth(np.full((3, 3, 3), 1500.0), (0.1,) * 3, (0.0,) * 3, axes="x,y,z")


@pytest.mark.parametrize(
    ("true", "result", "why"),
    [
        (known(axes="as displayed"), made(), "registered"),
        (known(axes="x,y,z"), made(), "axes x,y,z and 2 dimensions, the image 2"),
        (known(), made(slices=2), "the image 3"),
        (solid(), made(slices=2), "not evenly spaced"),
    ],
)
def test_rejects_truths_on_incompatible_grids(true, result, why):
    with pytest.raises(NotComparable, match=why):
        speed_on_grid(true, result)


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

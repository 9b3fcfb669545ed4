"""The errors against a truth, and the region they are read in."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.tomography.comparison import NotComparable, compare

from .squares import WATER, disc, image, truth


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


def test_several_slices_are_compared_with_a_solid_truth() -> None:
    solid = np.stack([disc(), np.full((17, 17), WATER), disc()[::-1]], axis=-1)
    assert compare(image(solid + 2.0, (0.0,) * 3), truth(solid)).rms == pytest.approx(2.0)
    assert compare(image(solid[..., ::-1], (0.0,) * 3), truth(solid)).rms > 10.0


def test_truth_outside_the_image_is_not_comparable() -> None:
    with pytest.raises(NotComparable, match="no node of the image lies within the truth"):
        compare(image(disc(), origin=(1.0, 1.0)), truth(disc()))

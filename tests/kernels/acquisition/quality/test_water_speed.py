"""The stated water speed against the travel times of chords through water."""

from dataclasses import replace

import pytest

from bentray_kernels.acquisition import Dataset, temperature_from_speed
from bentray_kernels.acquisition.quality import examine
from bentray_kernels.acquisition.quality.water_speed import WATER_SPEED, find_water_speed, water_summary

from ..reference.object_scans import half_disc, without_water
from ..traces import WATER_MPS

SIGMA_MPS = 0.4


def stated(mps: float, *, assumed: bool = False) -> Dataset:
    """The scan with another water speed in its file."""
    celsius = temperature_from_speed(mps)
    return replace(
        half_disc(), water_speed_mps=mps, water_temperature_c=celsius, water_temperature_assumed=assumed
    )


def found(dataset: Dataset) -> list:
    return [f for f in examine(dataset).report.findings if f.check == WATER_SPEED]


@pytest.mark.parametrize("off", [pytest.param(-2.0, marks=pytest.mark.nightly), 0.0, 2.0])
def test_errors_of_a_thermometer_are_no_finding(off):
    assert not found(without_water(stated(WATER_MPS + off)))


def test_a_temperature_that_contradicts_the_chords_is_reported_with_what_to_set():
    (finding,) = found(without_water(stated(1467.0)))
    assert finding.action == "reported"
    assert finding.value == pytest.approx(WATER_MPS, abs=1.0)
    assert finding.found.startswith(
        "water temperature contradicts the travel times: 15.3 °C means 1467.0 m/s"
    )
    assert "--sound-speed 1480" in finding.accepted


def test_with_a_water_shot_as_well():
    (finding,) = found(stated(1460.0))
    assert (finding.action, finding.value) == ("reported", pytest.approx(WATER_MPS, abs=2.0))


@pytest.mark.parametrize("water", [False, True])
def test_an_assumed_speed_is_replaced_by_that_of_the_chords(water):
    dataset = stated(1440.0, assumed=True)
    examined = examine(dataset if water else without_water(dataset))
    (finding,) = [f for f in examined.report.findings if f.check == WATER_SPEED]
    assert finding.action == "corrected"
    assert "is assumed" in finding.found
    assert examined.picked.water_speed_mps == pytest.approx(WATER_MPS, abs=1.0)
    assert not examined.picked.water_temperature_assumed


def test_a_stated_speed_that_no_water_explains_is_rejected():
    examined = examine(without_water(stated(1440.0)))
    assert examined.report.refusal.check == "sampling rate"


def test_a_fit_worse_than_the_assumption_does_not_replace_it():
    """Three standard deviations of the fit against five degrees, which are 15 m/s."""
    for sigma_mps in (5.1, 40.0):
        assert not find_water_speed(stated(1440.0, assumed=True), WATER_MPS, sigma_mps)
    assert find_water_speed(stated(1440.0, assumed=True), WATER_MPS, 4.9)


def test_the_summary_states_which_speed_is_used():
    close, far = stated(1479.0), stated(1440.0, assumed=True)
    assert water_summary(close, WATER_MPS, SIGMA_MPS) == (
        "Water of 1479.0 m/s (18.9 °C), as stated; chords that miss the object say 1480.0 ± 0.4 m/s "
        "(19.2 °C), 1.0 m/s more."
    )
    assert water_summary(far, WATER_MPS, SIGMA_MPS) == (
        "Water of 1480.0 ± 0.4 m/s (19.2 °C), by chords that miss the object; its temperature is not "
        "stated in the scan."
    )
    unsure = water_summary(far, WATER_MPS, 40.0)
    assert "one degree more raises every speed by 4 m/s" in unsure
    assert "say 1480.0 ± 40.0 m/s" in unsure

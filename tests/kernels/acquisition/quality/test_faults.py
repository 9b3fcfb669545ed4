"""Faults that real scans have, one planted in each scan, and the stated water speed against its chords."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset, Waveform, temperature_from_speed
from bentray_kernels.acquisition.quality import Finding, examine
from bentray_kernels.acquisition.quality.correction import apply
from bentray_kernels.acquisition.quality.estimated_water import estimate_water
from bentray_kernels.acquisition.quality.recording import Measured, check_traces
from bentray_kernels.acquisition.quality.shadow import find_scatterer
from bentray_kernels.acquisition.quality.water_speed import WATER_SPEED, find_water_speed, water_summary

from ..reference.object_scans import ELEMENTS, half_disc, without_water
from ..traces import WATER_MPS, later

# What is found in every scan without a water shot.
ALWAYS = "water shot"

Traces = Callable[[np.ndarray], np.ndarray]


def with_traces(change: Traces, *, water: bool) -> Dataset:
    """The scan with changed traces, with its water shot or without."""
    traces = half_disc().waveform
    assert traces is not None
    whole = replace(half_disc(), waveform=Waveform(change(traces.object), change(traces.water)))
    return whole if water else without_water(whole)


def found(dataset: Dataset) -> list[Finding]:
    """Findings in the traces, without picking them."""
    measured = Measured.from_dataset(dataset, range(len(dataset.tx)))
    findings, _ = check_traces(dataset, measured)
    if measured.water is None:
        findings += estimate_water(apply(dataset, findings), measured.object)[0]
    return [finding for finding in findings if finding.check != ALWAYS]


# Faults are harder to see without a water shot; one scan has them all with it (``test_planted_faults``).
both = pytest.mark.parametrize("water", [pytest.param(True, marks=pytest.mark.nightly), False])


@both
def test_no_fault_is_found_where_none_is_planted(water):
    assert not found(with_traces(lambda traces: traces, water=water))


def test_an_element_off_among_receivers_alone():
    """Every fourth element emits; element 17 only receives."""
    position = half_disc().element_position_m.copy()
    position[17] += 4e-4
    some = np.arange(0, ELEMENTS, 4)
    traces = half_disc().waveform
    emitted = Waveform(traces.object[some], traces.water[some])
    (finding,) = found(replace(half_disc(), tx=some, waveform=emitted, element_position_m=position))
    assert (finding.check, finding.elements) == ("displaced elements", (17,))


@both
@pytest.mark.parametrize(("a", "b"), [(5, 40), pytest.param(5, 6, marks=pytest.mark.nightly)])
def test_swapped_channels(water, a, b):
    order = np.arange(ELEMENTS)
    order[[a, b]] = b, a
    (finding,) = found(with_traces(lambda traces: traces[:, order], water=water))
    assert (finding.check, finding.elements, finding.role) == ("swapped channels", (a, b), "reception")
    assert finding.action == "corrected"


@both
def test_inverted_polarity(water):
    sign = np.ones((ELEMENTS, ELEMENTS, 1), dtype=np.float32)
    sign[20] *= -1.0
    sign[:, 9] *= -1.0
    findings = found(with_traces(lambda traces: sign * traces, water=water))
    assert {(f.check, f.elements, f.role) for f in findings} == {
        ("polarity", (20,), "emission"),
        ("polarity", (9,), "reception"),
    }


@both
def test_saturated_traces(water):
    def change(traces: np.ndarray) -> np.ndarray:
        clipped = traces.copy()
        clipped[:, 30:33] = np.clip(clipped[:, 30:33], -0.15, 0.15)
        return clipped

    findings = found(with_traces(change, water=water))
    assert {f.check for f in findings} == {"clipping"}
    assert all(f.elements == (30, 31, 32) for f in findings)


@both
def test_a_clock_offset_of_a_module(water):
    late = np.zeros((ELEMENTS, ELEMENTS))
    late[:, 16:24] = 3e-7
    (finding,) = found(
        with_traces(lambda traces: later(traces, late, half_disc().sampling_rate_hz), water=water)
    )
    assert (finding.check, finding.elements, finding.role) == (
        "clock offset",
        tuple(range(16, 24)),
        "reception",
    )
    assert finding.value == pytest.approx(3e-7, rel=0.05)


@pytest.mark.nightly
def test_times_are_right_in_spite_of_it():
    """The offset is part of the estimated water shot, as it is of a recorded one."""
    late = np.zeros((ELEMENTS, ELEMENTS))
    late[:, 16:24] = 3e-7
    times = [
        examine(
            with_traces(lambda traces: later(traces, late, half_disc().sampling_rate_hz), water=water)
        ).picked.differential_tof()
        for water in (True, False)
    ]
    off = (times[1] - times[0])[:, 16:24]
    assert np.isfinite(off).mean() > 0.9
    assert np.nanmedian(np.abs(off)) < 1e-8


@both
@pytest.mark.parametrize("off_m", [(5e-4, 0.0), pytest.param((0.0, 5e-4), marks=pytest.mark.nightly)])
def test_an_element_half_a_millimetre_off(water, off_m):
    position = half_disc().element_position_m.copy()
    position[17] += off_m
    (finding,) = found(replace(with_traces(lambda traces: traces, water=water), element_position_m=position))
    assert (finding.check, finding.elements) == ("displaced elements", (17,))
    assert finding.value == pytest.approx(5e-4, rel=0.25)


@both
def test_a_bubble(water):
    position, radius = np.array([0.012, -0.004]), 0.002
    start = half_disc().element_position_m[:, None]
    along = half_disc().element_position_m[None] - start
    part = ((position - start) * along).sum(axis=-1) / np.maximum((along**2).sum(axis=-1), 1e-30)
    nearest = start + np.clip(part, 0.0, 1.0)[..., None] * along - position
    left = 1.0 - 0.8 * np.exp(-((np.linalg.norm(nearest, axis=-1) / radius) ** 2))
    shadowed = (half_disc().waveform.object * left[..., None]).astype(np.float32)
    dataset = replace(half_disc(), waveform=Waveform(shadowed, half_disc().waveform.water))
    (finding,) = found(dataset if water else without_water(dataset))
    assert finding.check == "strong scatterer"
    assert "(12, -4) mm" in finding.found
    assert (left[finding.pairs] < 0.6).all()


@pytest.mark.parametrize(("half_waves", "seen"), [(1.5, True), (9.0, False)])
def test_a_scatterer_is_small_against_the_dark_chords_around_it(half_waves, seen):
    """A wide object, such as dense tissue, is no bubble, although all chords through it are dark."""
    dataset = replace(half_disc(), waveform=None, delta_tof_s=np.zeros((ELEMENTS, ELEMENTS)))
    start, end = (dataset.element_position_m[elements] for elements in np.indices((ELEMENTS, ELEMENTS)))
    along = (end - start) / np.maximum(np.linalg.norm(end - start, axis=-1, keepdims=True), 1e-9)
    passing_m = np.abs(along[..., 0] * start[..., 1] - along[..., 1] * start[..., 0])
    radius_m = half_waves * 0.5 * WATER_MPS / dataset.center_frequency_hz
    findings = list(find_scatterer(dataset, np.where(passing_m < radius_m, -2.0, 0.0)))
    assert [finding.check for finding in findings] == ["strong scatterer"] * seen


@both
@pytest.mark.parametrize("change_c", [0.5, pytest.param(-0.5, marks=pytest.mark.nightly)])
def test_water_that_warms_or_cools_during_the_scan(water, change_c):
    speed = WATER_MPS + 2.9 * change_c * (np.arange(ELEMENTS) / (ELEMENTS - 1.0) - 0.5)
    distance = half_disc().distance_m()
    late = distance / speed[:, None] - distance / WATER_MPS
    (finding,) = found(
        with_traces(lambda traces: later(traces, late, half_disc().sampling_rate_hz), water=water)
    )
    assert finding.check == "water temperature drift"
    assert finding.value == pytest.approx(2.9 * change_c, rel=0.15)
    assert f"{'warms' if change_c > 0.0 else 'cools'} by 0.5 °C" in finding.found


def test_an_element_is_dead_where_the_water_shot_has_no_pulse_of_it():
    """The object may hide an element; the water does not."""
    traces = half_disc().waveform
    water, hidden = traces.water.copy(), traces.object.copy()
    water[7], hidden[9] = 0.0, 0.0
    scans = (Waveform(traces.object, water), Waveform(hidden, traces.water))
    dead, none = (
        [finding for finding in found(replace(half_disc(), waveform=waveform)) if "dead" in finding.check]
        for waveform in scans
    )
    assert [(finding.elements, finding.role) for finding in dead] == [((7,), "emission")]
    assert none == []


SIGMA_MPS = 0.4


def stated(mps: float, *, assumed: bool = False) -> Dataset:
    """The scan with another water speed in its file."""
    celsius = temperature_from_speed(mps)
    return replace(
        half_disc(), water_speed_mps=mps, water_temperature_c=celsius, water_temperature_assumed=assumed
    )


def speed_findings(dataset: Dataset) -> list:
    return [f for f in examine(dataset).report.findings if f.check == WATER_SPEED]


@pytest.mark.parametrize("off", [pytest.param(-2.0, marks=pytest.mark.nightly), 0.0, 2.0])
def test_errors_of_a_thermometer_are_no_finding(off):
    assert not speed_findings(without_water(stated(WATER_MPS + off)))


def test_a_temperature_that_contradicts_the_chords_is_reported_with_what_to_set():
    (finding,) = speed_findings(without_water(stated(1467.0)))
    assert finding.action == "reported"
    assert finding.value == pytest.approx(WATER_MPS, abs=1.0)
    assert finding.found.startswith(
        "water temperature contradicts the travel times: 15.3 °C means 1467.0 m/s"
    )
    assert "--sound-speed 1480" in finding.accepted


def test_with_a_water_shot_as_well():
    (finding,) = speed_findings(stated(1460.0))
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

"""Chords through water around an object, and the water shot estimated from them against the recorded one."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.acquisition.picking.first_arrivals import pick
from bentray_kernels.acquisition.quality import examine
from bentray_kernels.acquisition.quality.estimated_water import estimate_water
from bentray_kernels.acquisition.quality.measures import Measures
from bentray_kernels.acquisition.reference.water_chords import (
    NEAREST,
    NEAREST_PART,
    chord_offset,
    find_water_chords,
)
from bentray_kernels.errors import InvalidInput

from ...straight_scans import chords_m
from ..traces import FREQUENCY_HZ, RADIUS_M, WATER_MPS, scan
from .object_scans import ELEMENTS, disc_delay_s, with_elements, without_water

DELAY_S = disc_delay_s(0.6 * RADIUS_M)


def estimated(dataset):
    bare = without_water(dataset)
    return estimate_water(bare, Measures.from_traces(bare.waveform.object, bare))[1]


@pytest.mark.parametrize(
    "start_s", [*(pytest.param(start, marks=pytest.mark.nightly) for start in (0.0, 1e-6)), -1e-6]
)
def test_estimate_matches_the_omitted_water_shot(start_s):
    dataset, emission, reception = with_elements(
        scan(DELAY_S, elements=ELEMENTS, noise=0.02), 3, start_s, 0.3
    )
    reference = estimated(dataset)
    assert reference.speed_mps == pytest.approx(WATER_MPS, abs=0.5)
    # The pulse is 1 at its arrival, and so is its envelope.
    assert reference.delay_s == pytest.approx(start_s, abs=0.02 / FREQUENCY_HZ)
    assert np.abs(reference.emission_delay_s).max() < 0.02 / FREQUENCY_HZ
    # Pulses of the scan do not spread with distance; the model's do, by a factor that all elements share.
    for computed, true in ((reference.emission_gain, emission), (reference.reception_gain, reception)):
        assert np.std((computed - true) - (computed - true).mean()) < 0.03
    shown = replace(reference, noise=0.0).applied(dataset).waveform.water
    clean, _, _ = with_elements(scan(DELAY_S, elements=ELEMENTS), 3, start_s, 0.3)
    true = clean.waveform.water
    for e in (0, 17):
        far = dataset.distance_m()[e] > 0.3 * RADIUS_M
        alike = [np.corrcoef(shown[e][r], true[e][r])[0, 1] for r in np.flatnonzero(far)]
        assert min(alike) > 0.95


def test_delays_of_elements_are_found():
    bare = scan(DELAY_S, elements=ELEMENTS, noise=0.01)
    late = 1e-7 * np.sin(np.arange(ELEMENTS))
    moved = scan(DELAY_S + late[:, None] + np.roll(late, 9), elements=ELEMENTS, noise=0.01)
    dataset = replace(bare, waveform=replace(bare.waveform, object=moved.waveform.object))
    reference = estimated(dataset)
    # Their mean belongs to the common delay, or to the pulse.
    both = reference.emission_delay_s[:, None] + reference.reception_delay_s
    off = both - late[:, None] - np.roll(late, 9)
    assert np.abs(off - off.mean()).max() < 1e-8


@pytest.mark.parametrize(
    "picker",
    [
        *(pytest.param(name, marks=pytest.mark.nightly) for name in ("aic", "threshold", "matched")),
        "correlation",
    ],
)
def test_times_are_those_with_the_water_shot(picker):
    dataset, _, _ = with_elements(scan(DELAY_S, elements=ELEMENTS, noise=0.03), 5, 0.0, 0.3)
    with_water = pick(dataset, picker)
    without = pick(estimated(dataset).applied(dataset), picker)
    both = np.isfinite(with_water.delta_tof_s) & np.isfinite(without.delta_tof_s)
    assert both.sum() > 0.95 * np.isfinite(with_water.delta_tof_s).sum()
    off = (without.delta_tof_s - with_water.delta_tof_s)[both]
    assert abs(np.median(off)) < 0.01 / FREQUENCY_HZ
    assert np.sqrt(np.mean(off**2)) < 2.0 * np.median(with_water.sigma_s[both])


def test_dead_elements_are_left_out_and_the_report_states_what_was_estimated():
    dataset, _, _ = with_elements(scan(DELAY_S, elements=ELEMENTS, noise=0.02), 7, 0.0, 0.3)
    dataset.waveform.object[11] = 0.02 * np.random.default_rng(0).standard_normal(
        dataset.waveform.object[11].shape
    )
    dataset.waveform.object[:, 40] = 0.0
    examined = examine(without_water(dataset))
    findings = {f.check: f for f in examined.report.findings}
    assert {"dead elements", "water shot"} <= set(findings)
    assert findings["water shot"].action == "reported"
    assert "chords that miss the object: water of 1480" in findings["water shot"].found
    delta = examined.picked.differential_tof()
    assert np.isnan(delta[11]).all()
    assert np.isnan(delta[:, 40]).all()
    others = np.delete(np.delete(delta - DELAY_S, 11, axis=0), 40, axis=1)
    assert np.nanmedian(np.abs(others)) < 0.02 / FREQUENCY_HZ


def test_an_object_that_fills_the_ring_is_rejected_with_what_to_give():
    full = disc_delay_s(0.999 * RADIUS_M, speed_mps=1300.0)
    full += 2e-6 * np.random.default_rng(2).random(full.shape)
    examined = examine(without_water(scan(full, elements=ELEMENTS, noise=0.02)))
    assert examined.report.refusal.check == "water shot"
    assert "a scan without the object" in examined.report.refusal.accepted


PERIOD_S = 1.0 / FREQUENCY_HZ
BARE = replace(scan(elements=ELEMENTS), waveform=None)


@given(
    radius_m=st.floats(0.1, 0.7).map(lambda part: part * RADIUS_M),
    position=st.floats(0.0, 2.0 * np.pi),
    off=st.floats(0.0, 1.0),
    speed_mps=st.sampled_from([1380.0, 1450.0, 1520.0, 1600.0]),
    water_mps=st.floats(1400.0, 1580.0),
    delay_s=st.floats(-5e-6, 5e-6),
    seed=st.integers(0, 2**16),
)
def test_speed_and_delay_are_those_of_the_water(radius_m, position, off, speed_mps, water_mps, delay_s, seed):
    """The disc may lie anywhere within four fifths of the ring."""
    reach = off * (0.8 * RADIUS_M - radius_m) if radius_m < 0.8 * RADIUS_M else 0.0
    centre = (reach * np.cos(position), reach * np.sin(position))
    inside = chords_m(BARE, radius_m, centre)
    arrival = delay_s + BARE.distance_m() / water_mps + inside * (1.0 / speed_mps - 1.0 / water_mps)
    arrival += 0.01 * PERIOD_S * np.random.default_rng(seed).standard_normal(arrival.shape)
    chords = find_water_chords(BARE, arrival)
    assert chords.speed_mps == pytest.approx(water_mps, abs=2.0)
    assert chords.delay_s == pytest.approx(delay_s, abs=0.03 * PERIOD_S)
    # A chord that only grazes the disc is as good as water.
    late = np.abs(inside * (1.0 / speed_mps - 1.0 / water_mps))[chords.pairs]
    assert np.median(late) == 0.0


def test_an_object_that_fills_the_ring_leaves_no_chord():
    arrival = BARE.distance_m() / WATER_MPS + disc_delay_s(0.995 * RADIUS_M, speed_mps=1250.0)
    arrival += 0.2 * PERIOD_S * np.random.default_rng(0).standard_normal(arrival.shape)
    with pytest.raises(
        InvalidInput, match=r"waveform/water: found no traces, and \d+ chords.*accepted: a scan"
    ):
        find_water_chords(BARE, arrival)


@pytest.mark.parametrize("count", [0, 20])
def test_too_few_arrivals_are_rejected(count):
    arrival = BARE.distance_m() / WATER_MPS
    arrival.ravel()[count:] = np.nan
    with pytest.raises(InvalidInput, match="waveform/water"):
        find_water_chords(BARE, arrival)


def test_invalid_pairs_are_not_used():
    arrival = BARE.distance_m() / WATER_MPS
    valid = np.random.default_rng(1).random(arrival.shape) < 0.7
    chords = find_water_chords(replace(BARE, valid=valid), arrival)
    assert not (chords.pairs & ~valid).any()
    assert chords.pairs.sum() > 0.5 * valid.sum()


def test_the_offset_of_a_chord_is_its_distance_from_the_centre():
    offset = chord_offset(BARE)
    apart = np.abs(BARE.tx[:, None] - BARE.rx)
    assert offset == pytest.approx(np.abs(np.cos(np.pi * apart / ELEMENTS)), abs=1e-12)


def test_chords_nearer_than_a_few_wavelengths_are_not_used_and_all_others_may_be():
    """Here the limit by wavelengths is below that by the size of the ring; in a slow pulse it is above."""
    distance = BARE.distance_m()
    for period_s in (PERIOD_S, 10.0 * PERIOD_S):
        limits = NEAREST * WATER_MPS * period_s, NEAREST_PART * distance.max()
        chords = find_water_chords(replace(BARE, center_frequency_hz=1.0 / period_s), distance / WATER_MPS)
        assert (chords.pairs == (distance > min(limits))).all()


@pytest.mark.parametrize(("part", "speed_mps"), [(0.7, 1440.0), (0.7, 1500.0), (0.8, 1530.0)])
def test_the_outermost_chords_show_the_line_where_most_chords_cross_the_object(part, speed_mps):
    """The line through most arrivals is that of the object; no outermost chord lies on it."""
    inside = chords_m(BARE, part * RADIUS_M, (0.0, 0.0))
    arrival = BARE.distance_m() / WATER_MPS + inside * (1.0 / speed_mps - 1.0 / WATER_MPS)
    chords = find_water_chords(BARE, arrival)
    assert chords.speed_mps == pytest.approx(WATER_MPS, abs=0.1)
    assert not inside[chords.pairs].any()

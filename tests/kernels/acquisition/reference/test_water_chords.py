"""Chords through water: found around any disc, rejected where the object fills the ring."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.acquisition.reference import find_water_chords
from bentray_kernels.acquisition.reference.water_chords import NEAREST, NEAREST_PART, chord_offset
from bentray_kernels.errors import InvalidInput

from ..traces import FREQUENCY_HZ, RADIUS_M, WATER_MPS, scan
from .object_scans import ELEMENTS, disc_delay_s, in_disc_m

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
    inside = in_disc_m(BARE, radius_m, centre)
    arrival = delay_s + BARE.distance_m() / water_mps + inside * (1.0 / speed_mps - 1.0 / water_mps)
    arrival += 0.01 * PERIOD_S * np.random.default_rng(seed).standard_normal(arrival.shape)
    chords = find_water_chords(BARE, arrival, PERIOD_S)
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
        find_water_chords(BARE, arrival, PERIOD_S)


@pytest.mark.parametrize("count", [0, 20])
def test_too_few_arrivals_are_rejected(count):
    arrival = BARE.distance_m() / WATER_MPS
    arrival.ravel()[count:] = np.nan
    with pytest.raises(InvalidInput, match="waveform/water"):
        find_water_chords(BARE, arrival, PERIOD_S)


def test_invalid_pairs_are_not_used():
    arrival = BARE.distance_m() / WATER_MPS
    valid = np.random.default_rng(1).random(arrival.shape) < 0.7
    chords = find_water_chords(replace(BARE, valid=valid), arrival, PERIOD_S)
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
        chords = find_water_chords(BARE, distance / WATER_MPS, period_s)
        assert (chords.pairs == (distance > min(limits))).all()


@pytest.mark.parametrize(("part", "speed_mps"), [(0.7, 1440.0), (0.7, 1500.0), (0.8, 1530.0)])
def test_the_outermost_chords_show_the_line_where_most_chords_cross_the_object(part, speed_mps):
    """The line through most arrivals is that of the object; no outermost chord lies on it."""
    inside = in_disc_m(BARE, part * RADIUS_M, (0.0, 0.0))
    arrival = BARE.distance_m() / WATER_MPS + inside * (1.0 / speed_mps - 1.0 / WATER_MPS)
    chords = find_water_chords(BARE, arrival, PERIOD_S)
    assert chords.speed_mps == pytest.approx(WATER_MPS, abs=0.1)
    assert not inside[chords.pairs].any()

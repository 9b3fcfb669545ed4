"""Checks that need pulses at known times, measures, corrections; most faults: ``test_planted_faults``."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.signal import hilbert

from bentray_kernels.acquisition import Dataset, Waveform, pick
from bentray_kernels.acquisition.quality import Examined, examine
from bentray_kernels.acquisition.quality.correction import apply, exchange_order, pairs_of
from bentray_kernels.acquisition.quality.finding import Finding
from bentray_kernels.acquisition.quality.measures import Measures, _envelope

from ..traces import FREQUENCY_HZ, RATE_HZ, blob_delay, ricker, scan

ELEMENTS = 32


@cache
def clean() -> Dataset:
    return scan(blob_delay(ELEMENTS), elements=ELEMENTS, noise=0.01)


@cache
def sought() -> np.ndarray:
    """Result of the clean scan, which every survivor must give too."""
    picked = examine(clean()).picked
    assert picked is not None
    return picked.differential_tof()


def names(examined: Examined) -> list[str]:
    return [finding.check for finding in examined.report.findings]


def assert_survived(examined: Examined, atol: float) -> None:
    """The times are those of the clean scan."""
    assert examined.picked is not None
    delta = examined.picked.differential_tof()
    kept = np.isfinite(sought())
    assert np.isfinite(delta[kept]).mean() > 0.99
    both = kept & np.isfinite(delta)
    np.testing.assert_allclose(delta[both], sought()[both], atol=atol)


def test_clean_scan_has_no_findings_and_is_unchanged():
    examined = examine(clean())
    assert examined.report.verdict == "clean"
    assert examined.report.findings == ()
    assert examined.report.usable > 0.8 * examined.report.pairs


@pytest.mark.parametrize("noise", [0.1, 0.2, 0.25])
def test_noise_alone_is_no_fault(noise):
    """Where half of the pulses drown, the others give the times that they give unexamined."""
    noisy = scan(blob_delay(ELEMENTS), elements=ELEMENTS, noise=noise, seed=4)
    examined = examine(noisy)
    assert set(names(examined)) <= {"cycle jumps", "outliers", "reciprocity"}
    np.testing.assert_array_equal(examined.picked.differential_tof(), pick(noisy).differential_tof())


def test_a_recording_that_starts_at_the_wrong_time_is_moved():
    examined = examine(replace(clean(), t0_s=clean().t0_s + 8.0e-6))
    (result,) = (f for f in examined.report.findings if f.check == "time zero of the recording")
    assert result.value == pytest.approx(8.0e-6, abs=2e-8)
    assert_survived(examined, atol=4e-9)


def test_outliers_and_cycle_jumps_are_distinguished_and_left_out():
    random = np.random.default_rng(2)
    delta = np.array(sought())
    pairs = np.argwhere(np.isfinite(delta))
    wrong = pairs[random.permutation(len(pairs))[: len(pairs) // 20]]
    half = len(wrong) // 2
    planted = np.zeros_like(delta, dtype=bool)
    planted[tuple(wrong.T)] = True
    sign = random.choice([-1.0, 1.0], len(wrong))
    delta[tuple(wrong[:half].T)] += sign[:half] / FREQUENCY_HZ
    delta[tuple(wrong[half:].T)] += sign[half:] * 1.5 / FREQUENCY_HZ
    examined = examine(replace(clean(), waveform=None, delta_tof_s=delta))
    by_name = {f.check: f for f in examined.report.findings}
    assert by_name["cycle jumps"].action == by_name["outliers"].action == "left out"
    jumps, outliers = by_name["cycle jumps"].pairs, by_name["outliers"].pairs
    assert jumps[tuple(wrong[:half].T)].mean() > 0.9
    assert outliers[tuple(wrong[half:].T)].mean() > 0.9
    result = np.isnan(examined.picked.differential_tof()) & np.isfinite(delta)
    assert result[planted].mean() > 0.98
    # The reverse of an outlier is not at fault.
    assert result[~planted].mean() < 0.01


def test_a_whole_region_that_contradicts_its_reverse_is_left_out():
    delta = np.array(sought())
    delta[4:14, 17:30] += 8.0e-7
    examined = examine(replace(clean(), waveform=None, delta_tof_s=delta))
    assert "reciprocity" in names(examined)
    left = np.isnan(examined.picked.differential_tof())
    assert left[6:12, 20:27].all()
    assert left.T[6:12, 20:27].all()


def test_without_a_water_shot_it_is_estimated_where_times_are_picked():
    alone = replace(clean(), waveform=Waveform(clean().waveform.object))
    (finding,) = examine(alone).report.findings
    assert (finding.check, finding.action) == ("water shot", "reported")
    assert finding.value == pytest.approx(clean().water_speed_mps, rel=2e-3)
    assert examine(replace(alone, delta_tof_s=sought())).report.findings == ()


@pytest.mark.parametrize("factor", [0.4, 2.5])
def test_a_wrong_centre_frequency_is_rejected(factor):
    examined = examine(replace(clean(), center_frequency_hz=factor * FREQUENCY_HZ))
    assert examined.report.refusal.check == "centre frequency"
    assert examined.report.refusal.value == pytest.approx(1.0 / factor, rel=0.25)


def test_random_errors_of_the_drawing_are_named_and_no_other_fault():
    off = 3e-4 * np.random.default_rng(2).standard_normal((ELEMENTS, 2))
    examined = examine(replace(clean(), element_position_m=clean().element_position_m + off))
    assert names(examined) == ["element positions"]
    assert examined.report.findings[0].value == pytest.approx(4e-4, rel=0.3)


def test_slices_are_examined_one_by_one():
    sign = np.where(np.arange(ELEMENTS) == 5, -1.0, 1.0).astype(np.float32)[:, None, None]
    whole, water = clean().waveform.object, clean().waveform.water
    both = replace(
        clean(),
        slice_z_m=np.array([0.0, 0.01]),
        waveform=Waveform(np.stack([whole, sign * whole]), np.stack([water, sign * water])),
    )
    examined = examine(both)
    assert [(f.check, f.slice) for f in examined.report.findings] == [("polarity", 1)]
    delta = examined.picked.differential_tof()
    np.testing.assert_array_equal(np.isfinite(delta[0]), np.isfinite(delta[1]))
    np.testing.assert_allclose(delta[0], delta[1], atol=1e-12)
    np.testing.assert_array_equal(
        apply(both.slice(1), examined.report.findings).waveform.water, clean().waveform.water
    )


def test_the_report_is_plain_json():
    examined = examine(replace(clean(), waveform=None, delta_tof_s=np.where(np.eye(32) > 0, np.nan, 1e-6)))
    told = json.loads(json.dumps(examined.report.to_dict(), allow_nan=False))
    assert told["verdict"] == "usable"
    assert told["findings"][0]["check"] == "time zero of the object scan"
    assert told["usable_pairs"] == ELEMENTS * (ELEMENTS - 1)


@pytest.mark.parametrize("fill", [0.0, 3.0, np.nan, np.inf, "noise"])
@pytest.mark.parametrize("shape", [(3, 3, 40), (1, 8, 2), (8, 2, 300)])
def test_rejects_an_empty_scan(fill, shape):
    random = np.random.default_rng(0)
    ntx, nrx, _ = shape
    traces = [
        (random.standard_normal(shape) if fill == "noise" else np.full(shape, fill)).astype(np.float32)
        for _ in range(2)
    ]
    some = replace(clean(), tx=np.arange(ntx), rx=np.arange(16, 16 + nrx), waveform=Waveform(*traces))
    examined = examine(some)
    assert examined.picked is None
    assert examined.report.refusal.accepted


@pytest.mark.parametrize("frequency_hz", [FREQUENCY_HZ, None])
def test_cycle_jumps_are_checked_only_where_the_period_is_known(frequency_hz) -> None:
    times = replace(clean(), delta_tof_s=sought(), waveform=None, center_frequency_hz=frequency_hz)
    report = examine(times).report
    assert ("cycle jumps" in report.checked) == (frequency_hz is not None)
    assert ("cycle jumps" in report.not_checked) == (frequency_hz is None)


@pytest.mark.parametrize("start_s", [-4e-6, 0.0, 1e-5])
def test_the_maximum_of_a_pulse_is_at_its_time_after_the_time_zero(start_s):
    dataset = replace(scan(elements=4), t0_s=start_s)
    time = start_s + np.arange(200) / RATE_HZ
    at = start_s + np.array([6e-6, 9.03e-6, 12.51e-6])
    measures = Measures.from_traces([7.0 + ricker(time - at[:, None], FREQUENCY_HZ)], dataset)
    assert measures.strongest_s[0] == pytest.approx(at, abs=0.02 / RATE_HZ)
    assert measures.detected.all()
    assert not (measures.broken | measures.constant | measures.clipped).any()
    assert measures.peak[0] == pytest.approx(1.0, abs=0.1)


@given(
    hnp.arrays(np.float64, st.tuples(st.integers(1, 3), st.integers(1, 40)), elements=st.floats(-1e3, 1e3))
)
def test_the_envelope_is_that_of_scipy(traces):
    np.testing.assert_allclose(_envelope(traces), np.abs(hilbert(traces, axis=1)), atol=1e-9)


def test_a_tone_has_a_flat_one():
    tone = np.sin(2 * np.pi * 5 * np.arange(100) / 100)[None]
    assert _envelope(tone) == pytest.approx(np.ones((1, 100)))


# Elements in another order among emissions than among receptions, and fewer of them.
SCAN = replace(scan(elements=6), waveform=None, tx=np.array([4, 0, 5, 2]), rx=np.array([1, 2, 3, 4, 5]))


def finding(role, *elements):
    return Finding("swapped", "", "", "corrected", elements=elements, role=role)


@pytest.mark.parametrize(
    ("role", "axis", "order"), [("emission", 0, [3, 1, 2, 0]), ("reception", 1, [0, 3, 2, 1, 4])]
)
def test_two_channels_are_exchanged_where_they_are(role, axis, order):
    result, along = exchange_order(SCAN, finding(role, 2, 4))
    assert (result.tolist(), along) == (order, axis)


def test_pairs_of_an_element_are_its_row_or_its_column():
    rows, columns = (pairs_of(SCAN, finding(role, 4, 5)) for role in ("emission", "reception"))
    assert np.array_equal(rows, np.isin(SCAN.tx, (4, 5))[:, None] & np.ones(5, bool))
    assert np.array_equal(columns, np.ones((4, 1), bool) & np.isin(SCAN.rx, (4, 5)))

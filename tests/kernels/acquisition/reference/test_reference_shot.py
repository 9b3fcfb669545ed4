"""The estimated water shot against the one that was left out."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition.picking.first_arrivals import pick
from bentray_kernels.acquisition.quality import examine
from bentray_kernels.acquisition.quality.estimated_water import estimate_water
from bentray_kernels.acquisition.quality.measures import Measures

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

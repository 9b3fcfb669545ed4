"""Standard deviations of full-waveform images: both halves of the emitters, and what smoothing takes away."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from bentray_kernels.acquisition import pick
from bentray_kernels.tomography import Settings, reconstruct
from bentray_kernels.tomography.scan import MemorySource
from bentray_kernels.tomography.waveform import half_runs
from bentray_kernels.tomography.waveform.automatic_settings import scale_of
from bentray_kernels.tomography.waveform.half_runs import deviation, half_plans, half_plans_after
from bentray_kernels.tomography.waveform.inversion_state import BandEnd, Image
from bentray_kernels.tomography.waveform.wave_scan import WaveScan
from bentray_kernels.tomography.waveform.waveform_settings import WaveSettings, bands, loss_band

from .scans import CENTRE_HZ, WATER, blob, scan

PLAN = WaveSettings((*bands(CENTRE_HZ), loss_band(CENTRE_HZ)), nearest_m=0.01)


def recorded():
    made = scan(seed=3)
    return replace(pick(made), waveform=made.waveform)


def test_halves_share_no_emitter_and_leave_none_out():
    few = replace(PLAN, bands=tuple(replace(band, emitters=8) for band in PLAN.bands))
    used = [WaveScan(MemorySource(recorded()), plan).problem(0).used for plan in half_plans(few)]
    assert len(used[0]) == len(used[1]) == 4
    assert not set(used[0]) & set(used[1])
    whole = WaveScan(MemorySource(recorded()), replace(few, bands=few.bands[2:4], held_out=0)).problem(0).used
    assert sorted(np.concatenate(used)) == sorted(whole)


def test_the_last_bands_of_the_speed_run_again_from_the_image_before_them():
    start = Image(np.ones((2, 2)), 1e-3, (0.0, 0.0))
    one = replace(start, speed=2.0 * start.speed)
    done, skipped = BandEnd(one, False, (object(),)), BandEnd(one, False, ())
    plans, before = half_plans_after(PLAN, (skipped, done, done, done, done), start)
    assert [band.high_hz for band in plans[0].bands] == [band.high_hz for band in PLAN.bands[2:4]]
    assert before is one
    # Bands that did not run do not count; the image before the first one is the initial one.
    plans, before = half_plans_after(PLAN, (done, skipped, skipped, skipped, done), start)
    assert [band.high_hz for band in plans[0].bands] == [PLAN.bands[0].high_hz]
    assert before is start
    assert half_plans(replace(PLAN, bands=(replace(PLAN.bands[0], emitters=6),))) == ()


def test_both_halves_cost_less_than_the_image():
    image = sum(band.evaluations(PLAN.held_out) for band in PLAN.bands)
    assert 0.3 * image < half_runs.passes(PLAN) < image
    settings = Settings.from_values(method="waveform", attenuation=False)
    scale = scale_of(recorded(), settings, 120, 1)
    alone, both = scale.minutes(settings), scale.minutes(settings.changed(uncertainty=True))
    assert 1.5 * alone < both < 2.1 * alone


def test_half_the_difference_of_the_halves_is_the_deviation():
    random = np.random.default_rng(2)
    flat = Image(np.full((60, 60), 1500.0), 1e-3, (0.0, 0.0))
    halves = [replace(flat, speed=1500.0 + 8.0 * random.standard_normal((60, 60))) for _ in range(2)]
    # The mean of two halves of deviation 8 has that divided by the root of two.
    found = deviation(flat, halves, 1e-3)
    assert found[10:-10, 10:-10].mean() == pytest.approx(8.0 / np.sqrt(2.0), rel=0.1)
    # Equal halves leave what the smoothing takes from an edge.
    edge = replace(flat, speed=np.where(np.arange(60)[:, None] < 30, 1500.0, 1540.0) * np.ones((60, 60)))
    found = deviation(edge, [edge, edge], 2e-3)
    assert np.allclose(found, np.abs(edge.speed - gaussian_filter(edge.speed, 2.0, mode="nearest")))


def test_differences_are_averaged_over_three_widths_of_the_smoothed_truth():
    """A difference at one node spreads as a Gaussian of that size; its root falls half as fast."""
    flat = Image(np.full((81, 81), 1500.0), 1e-3, (0.0, 0.0))
    speed = flat.speed.copy()
    speed[40, 40] += 100.0
    spread = deviation(flat, [flat, replace(flat, speed=speed)], 2e-3)[40, 40:]
    away = 1e-3 * np.arange(13)
    np.testing.assert_allclose(spread[:13], spread[0] * np.exp(-((away / 6e-3) ** 2) / 4.0), rtol=0.01)
    assert spread[0] == pytest.approx(50.0 / (6.0 * np.sqrt(2.0 * np.pi)), rel=0.01)


@pytest.fixture(scope="module")
def refined():
    plan = Settings.from_values(
        method="waveform", rays="straight", nodes=32, iterations=2, bands=2, emitters=8, attenuation=False
    )
    seen = []
    plain = reconstruct(recorded(), plan)
    return plain, reconstruct(recorded(), plan.changed(uncertainty=True), seen.append), seen


@pytest.mark.nightly
def test_most_nodes_lie_within_two_deviations(refined):
    plain, found, seen = refined
    assert np.array_equal(found.speed, plain.speed)
    assert found.history == plain.history
    assert plain.uncertainty is None
    assert found.resolution_width_m == pytest.approx((0.15 * WATER / (0.75 * CENTRE_HZ),))
    x, y = (
        o + h * np.arange(n)
        for o, h, n in zip(found.origin_m, found.spacing_m, found.speed.shape, strict=True)
    )
    truth = gaussian_filter(
        blob(x[:, None], y[None, :]), found.resolution_width_m[0] / found.spacing_m[0], mode="nearest"
    )
    inside = np.hypot(x[:, None], y[None, :]) < 0.015
    within = np.abs(found.speed - truth)[inside] < 2.0 * found.uncertainty[inside]
    assert within.mean() >= 0.85
    assert found.uncertainty[inside].max() < 20.0
    assert found.uncertainty[0, 0] == 0.0
    assert seen[-1].done == seen[-1].total

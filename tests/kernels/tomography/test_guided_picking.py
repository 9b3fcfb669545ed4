"""Picking and reconstruction in turn: what the image predicts, and what that brings in noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition import pick
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Settings, reconstruct
from bentray_kernels.tomography.guided_picking import predicted_delta, reconstruct_guided

from ..acquisition.traces import RADIUS_M, blob_delay, scan

ELEMENTS = 24
SETTINGS = Settings.of(
    method="gauss-newton", rays="straight", nodes=32, iterations=2, attenuation=False, penalty="laplacian"
)


def test_an_image_predicts_the_times_it_was_made_from():
    delay = blob_delay(ELEMENTS)
    picked = pick(scan(delay, elements=ELEMENTS))
    result = reconstruct(picked, SETTINGS)
    predicted = predicted_delta(picked, result)
    off = ~np.eye(ELEMENTS, dtype=bool)
    assert np.isfinite(predicted[off]).all()
    assert np.isnan(np.diag(predicted)).all()
    far = scan(elements=ELEMENTS).distance_m() > RADIUS_M
    assert np.sqrt(np.mean((predicted - delay)[far] ** 2)) < 0.15 * delay.max()


def test_slices_are_predicted_one_by_one():
    picked = pick(scan(blob_delay(ELEMENTS), elements=ELEMENTS))
    two = replace(
        picked,
        slice_z_m=np.array([0.0, 0.01]),
        delta_tof_s=np.stack([picked.delta_tof_s, 0.0 * picked.delta_tof_s]),
        sigma_s=None,
    )
    predicted = predicted_delta(two, reconstruct(two, SETTINGS))
    alone = predicted_delta(picked, reconstruct(picked, SETTINGS))
    np.testing.assert_allclose(predicted[0], alone, atol=1e-12)
    assert np.nanmax(np.abs(predicted[1])) < 0.05 * np.nanmax(np.abs(alone))


def test_in_noise_the_image_finds_more_arrivals_and_no_worse_ones():
    delay = blob_delay(ELEMENTS)
    noisy = scan(delay, elements=ELEMENTS, noise=0.22, seed=4)
    far = noisy.distance_m() > RADIUS_M
    alone = pick(noisy).delta_tof_s
    guided, result = reconstruct_guided(noisy, SETTINGS, rounds=2)
    assert result.speed.shape == (32, 32)

    def right(found: np.ndarray) -> int:
        with np.errstate(invalid="ignore"):
            return int((np.abs(found - delay) < 1.5e-7)[far].sum())

    assert right(guided.delta_tof_s) >= right(alone)
    wrong = [int((np.abs(found - delay) >= 1.5e-7)[far].sum()) for found in (guided.delta_tof_s, alone)]
    assert wrong[0] <= wrong[1]


def test_without_rounds_nothing_is_guided_and_settled_picks_end_it():
    quiet = scan(blob_delay(ELEMENTS), elements=ELEMENTS)
    seen: list[int] = []
    picked, _ = reconstruct_guided(quiet, SETTINGS, rounds=0, progress=lambda p: seen.append(p.done))
    np.testing.assert_array_equal(picked.delta_tof_s, pick(quiet).delta_tof_s)
    once = len(seen)
    seen.clear()
    reconstruct_guided(quiet, SETTINGS, rounds=5, progress=lambda p: seen.append(p.done))
    assert len(seen) < 3 * once


@pytest.mark.parametrize(
    ("settings", "rounds"),
    [(SETTINGS, -1), (replace(SETTINGS, decomposition="volume"), 1)],
)
def test_what_cannot_be_alternated_is_refused(settings, rounds):
    with pytest.raises(InvalidInput):
        reconstruct_guided(scan(elements=ELEMENTS), settings, rounds)

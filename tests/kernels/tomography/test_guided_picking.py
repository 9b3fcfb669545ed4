"""Travel times that an image predicts for every pair."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition import pick
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Settings, reconstruct
from bentray_kernels.tomography.guided_picking import SETTLED_S, predicted_delta, same_picks

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


def test_a_volume_is_rejected():
    picked = pick(scan(blob_delay(ELEMENTS), elements=ELEMENTS))
    result = replace(reconstruct(picked, SETTINGS), settings=replace(SETTINGS, decomposition="volume"))
    with pytest.raises(InvalidInput, match="decomposition"):
        predicted_delta(picked, result)


def test_picks_are_the_same_until_they_move_by_more_than_the_limit():
    before = pick(scan(blob_delay(8), elements=8))

    def moved(by):
        return replace(before, delta_tof_s=before.delta_tof_s + by)

    assert same_picks(before, before)
    assert same_picks(before, moved(0.9 * SETTLED_S))
    assert not same_picks(before, moved(1.1 * SETTLED_S))
    one_less = np.where(np.arange(64).reshape(8, 8) == 12, np.nan, before.delta_tof_s)
    assert not same_picks(before, replace(before, delta_tof_s=one_less))
    nothing = replace(before, delta_tof_s=np.full((8, 8), np.nan))
    assert same_picks(nothing, nothing)

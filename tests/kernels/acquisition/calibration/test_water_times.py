"""Travel times of water shots follow the true element positions, not the nominal ones."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition import Waveform
from bentray_kernels.acquisition.calibration import calibrate, water_times
from bentray_kernels.errors import InvalidInput

from ..traces import FREQUENCY_HZ, RADIUS_M, RATE_HZ, WATER_MPS, scan


def displaced(noise: float = 0.0):
    """A scan whose elements stand up to 1 mm off their drawing, and the displacement."""
    random = np.random.default_rng(1)
    true = scan(elements=24)
    change = 3e-4 * random.standard_normal((24, 2))
    position = true.element_position_m + change
    distance = np.linalg.norm(position[:, None] - position[None], axis=-1)
    late = (distance - true.distance_m()) / WATER_MPS
    # The object's traces of ``scan`` are the water's, later by as much as asked.
    moved = scan(late, elements=24, noise=noise)
    both = Waveform(moved.waveform.object, moved.waveform.object)
    return replace(moved, waveform=both), distance / WATER_MPS, change


def test_times_are_subsample_exact_up_to_a_common_offset():
    dataset, arrival, _ = displaced()
    late = water_times(dataset) - arrival
    far = dataset.distance_m() > 0.02
    assert np.isfinite(late[far]).all()
    assert np.nanmedian(np.abs(late - np.nanmedian(late))) < 0.02 / RATE_HZ
    assert abs(np.nanmedian(late)) < 0.5 / FREQUENCY_HZ


def test_traces_calibrate_the_array():
    dataset, _, change = displaced(noise=0.02)
    calibrated = calibrate(dataset, water_times(dataset))
    before = np.sqrt((change**2).mean())
    off = calibrated.element_position_m - dataset.element_position_m - change
    off -= off.mean(axis=0)
    turn = np.column_stack((-dataset.element_position_m[:, 1], dataset.element_position_m[:, 0]))
    off -= turn * (off * turn).sum() / (turn * turn).sum()
    assert np.sqrt((off**2).mean()) < 0.15 * before
    assert np.abs(calibrated.element_position_m).max() < RADIUS_M + 2e-3


def test_silent_broken_and_masked_traces_have_no_time():
    dataset, _, _ = displaced()
    water = dataset.waveform.water.copy()
    water[3, 12], water[4, 13] = 0.0, np.nan
    valid = np.ones((24, 24), dtype=bool)
    valid[5, 14] = False
    times = water_times(replace(dataset, waveform=Waveform(dataset.waveform.object, water), valid=valid))
    assert np.isnan(times[[3, 4, 5], [12, 13, 14]]).all()
    with pytest.raises(InvalidInput, match="waveform/water"):
        water_times(replace(dataset, waveform=Waveform(dataset.waveform.object)))

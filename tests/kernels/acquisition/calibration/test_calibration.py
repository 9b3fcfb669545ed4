"""Calibration: planted positions, delays and speed are recovered, also from the traces of a water shot."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.acquisition import Dataset, Waveform
from bentray_kernels.acquisition.calibration import calibrate, water_times
from bentray_kernels.errors import InvalidInput

from ...straight_scans import ring_scan
from ..traces import FREQUENCY_HZ, RADIUS_M, RATE_HZ, WATER_MPS, ring, scan

ELEMENTS = 32
COMMON_S = 1.3e-6


def drawn(speed: float = WATER_MPS) -> Dataset:
    return ring_scan(ELEMENTS, RADIUS_M, water_mps=speed)


def without_gauge(change: np.ndarray, *, size: bool = False) -> np.ndarray:
    """A displacement less its shift and turn, which no water shot tells."""
    position = ring(len(change)) - ring(len(change)).mean(axis=0)
    turn = np.column_stack((-position[:, 1], position[:, 0]))
    shifts = (np.broadcast_to(axis, change.shape) for axis in np.eye(2))
    modes = [*shifts, turn, *([position] if size else [])]
    for mode in modes:
        change = change - mode * (change * mode).sum() / (mode * mode).sum()
    return change


class Planted:
    """Errors of an array and the times of its water shot."""

    def __init__(self, seed: int = 0, *, off_m=3e-4, delay_s=1e-7, noise_s=0.0, speed=WATER_MPS, size=False):
        random = np.random.default_rng(seed)
        self.change = without_gauge(off_m * random.standard_normal((ELEMENTS, 2)), size=size)
        emission, reception = delay_s * random.standard_normal((2, ELEMENTS))
        self.emission, self.reception = emission - emission.mean(), reception - reception.mean()
        position = ring(ELEMENTS) + self.change
        distance = np.linalg.norm(position[:, None] - position[None], axis=-1)
        self.times = COMMON_S + self.emission[:, None] + self.reception[None] + distance / speed
        self.times += noise_s * random.standard_normal(self.times.shape)
        np.fill_diagonal(self.times, np.nan)


@given(seed=st.integers(0, 999))
@settings(max_examples=8, deadline=None)
def test_positions_and_delays_come_back_exactly_without_noise(seed):
    planted = Planted(seed)
    calibrated = calibrate(drawn(), planted.times)
    # Conventions hold for small changes; a turn by the square of a change remains.
    off = without_gauge(calibrated.element_position_m - ring(ELEMENTS) - planted.change)
    assert np.abs(off).max() < 2e-8
    np.testing.assert_allclose(calibrated.emission_delay_s, planted.emission, atol=2e-11)
    np.testing.assert_allclose(calibrated.reception_delay_s, planted.reception, atol=2e-11)
    assert calibrated.common_delay_s == pytest.approx(COMMON_S, abs=1e-10)
    assert calibrated.residual_rms_s < 1e-11


def test_an_eccentricity_of_a_millimetre_comes_back():
    """A ring that is 1 mm longer one way than drawn, and shorter the other."""
    planted = Planted(off_m=0.0, delay_s=0.0)
    angle = 2.0 * np.pi * np.arange(ELEMENTS) / ELEMENTS
    change = 1e-3 * np.column_stack((np.cos(angle), -np.sin(angle)))
    position = ring(ELEMENTS) + change
    planted.times = COMMON_S + np.linalg.norm(position[:, None] - position[None], axis=-1) / WATER_MPS
    calibrated = calibrate(drawn(), planted.times)
    assert np.abs(without_gauge(calibrated.element_position_m - position)).max() < 1e-7


def test_shift_and_rotation_of_the_whole_array_are_unobservable():
    position = ring(ELEMENTS) @ np.array([[0.8, -0.6], [0.6, 0.8]]) + [1e-3, 0.0]
    times = np.linalg.norm(position[:, None] - position[None], axis=-1) / WATER_MPS
    calibrated = calibrate(drawn(), times)
    np.testing.assert_allclose(calibrated.element_position_m, ring(ELEMENTS), atol=1e-8)


def test_estimated_deviations_match_the_errors():
    normalised: dict[str, list[np.ndarray]] = {"position": [], "emission": [], "reception": []}
    for seed in range(8):
        planted = Planted(seed, noise_s=2e-8)
        fitted = calibrate(drawn(), planted.times)
        off = fitted.element_position_m - ring(ELEMENTS) - planted.change
        normalised["position"].append((off / fitted.position_sigma_m).ravel())
        normalised["emission"].append((fitted.emission_delay_s - planted.emission) / fitted.emission_sigma_s)
        normalised["reception"].append(
            (fitted.reception_delay_s - planted.reception) / fitted.reception_sigma_s
        )
        assert fitted.residual_rms_s == pytest.approx(2e-8, rel=0.15)
    for name, values in normalised.items():
        assert 0.85 < np.concatenate(values).std() < 1.2, name


@pytest.mark.parametrize("speed", [1450.0, 1510.0])
def test_the_speed_is_fitted_where_the_size_is_trusted(speed):
    errors = []
    for seed in range(4):
        planted = Planted(seed, speed=speed, noise_s=1e-8, size=True)
        calibrated = calibrate(drawn(), planted.times, fit_speed=True)
        errors.append((calibrated.water_speed_mps - speed) / calibrated.water_speed_sigma_mps)
        assert abs(calibrated.water_speed_mps - speed) < 2.0
    assert np.sqrt(np.mean(np.square(errors))) < 2.5
    given_speed = calibrate(drawn(), planted.times)
    assert given_speed.water_speed_mps == pytest.approx(WATER_MPS)
    assert given_speed.water_speed_sigma_mps == 0.0


def test_wrong_times_are_left_out_and_dead_elements_stay_where_they_are():
    planted = Planted(3, noise_s=1e-8)
    random = np.random.default_rng(1)
    wrong = random.random(planted.times.shape) < 0.05
    planted.times[wrong] += random.choice([-1e-6, 1e-6], int(wrong.sum()))
    planted.times[7] = planted.times[:, 7] = np.nan
    calibrated = calibrate(drawn(), planted.times)
    others = np.arange(ELEMENTS) != 7
    np.testing.assert_array_equal(calibrated.element_position_m[7], ring(ELEMENTS)[7])
    assert np.isnan(calibrated.position_sigma_m[7]).all()
    assert np.isnan(calibrated.emission_sigma_s[7])
    assert calibrated.left_out >= 0.9 * (wrong & np.isfinite(planted.times)).sum()
    off = (calibrated.element_position_m - ring(ELEMENTS) - planted.change)[others]
    off -= off.mean(axis=0)
    assert np.sqrt((off**2).mean()) < 5e-5
    told = json.loads(json.dumps(calibrated.to_dict(), allow_nan=False))
    assert told["position_sigma_m"][7] == [None, None]


def test_a_calibrated_dataset_has_the_positions_and_the_speed():
    planted = Planted(5, speed=1500.0, size=True)
    calibrated = calibrate(drawn(), planted.times, fit_speed=True)
    applied = calibrated.applied(replace(drawn(), water_temperature_c=20.0))
    np.testing.assert_array_equal(applied.element_position_m, calibrated.element_position_m)
    assert applied.water_speed_mps == calibrated.water_speed_mps
    assert applied.water_temperature_c is None


def test_rejects_scans_that_cannot_be_calibrated():
    planted = Planted()
    with pytest.raises(InvalidInput, match="times_s: found shape"):
        calibrate(drawn(), planted.times[1:])
    with pytest.raises(InvalidInput, match="usable times"):
        calibrate(drawn(), np.full_like(planted.times, np.nan))
    space = replace(drawn(), element_position_m=np.column_stack((ring(ELEMENTS), np.zeros(ELEMENTS))))
    with pytest.raises(InvalidInput, match="elements in a plane"):
        calibrate(space, planted.times)


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
    off = without_gauge(calibrated.element_position_m - dataset.element_position_m - change)
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

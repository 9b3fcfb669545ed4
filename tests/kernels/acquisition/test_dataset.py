"""The dataset in memory: differences, slices, and the rules its fields keep."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.acquisition import Dataset, Truth, Waveform
from bentray_kernels.errors import InvalidInput

from .traces import ring

EVERY = np.arange(8)
TRACES = np.zeros((2, 2, 2), np.int16)


def made(**fields) -> Dataset:
    fields = {"delta_tof_s": np.zeros((8, 8)), **fields}
    return Dataset(element_position_m=ring(8), tx=EVERY, rx=EVERY, water_speed_mps=1480.0, **fields)


@given(st.floats(1300.0, 1700.0))
def test_absolute_times_become_differences_to_the_straight_water_path(speed):
    dataset = made(delta_tof_s=None)
    dataset = replace(dataset, tof_s=dataset.distance_m() / speed)
    expected = dataset.distance_m() * (1.0 / speed - 1.0 / 1480.0)
    off = ~np.eye(8, dtype=bool)
    delta = dataset.differential_tof()
    np.testing.assert_allclose(delta[off], expected[off], atol=1e-15)
    assert np.isnan(delta[~off]).all()


def test_invalid_pairs_are_missing_and_the_dataset_keeps_its_own():
    valid = np.ones((8, 8), dtype=bool)
    valid[1, 4] = False
    dataset = made(valid=valid)
    assert np.isnan(dataset.differential_tof()[1, 4])
    assert dataset.delta_tof_s[1, 4] == 0.0


def test_a_dataset_without_travel_times_is_not_picked():
    raw = made(delta_tof_s=None)
    assert not raw.picked
    with pytest.raises(InvalidInput, match="run a picker first"):
        raw.differential_tof()


def test_a_slice_is_a_plain_dataset():
    delta = np.arange(128.0).reshape(2, 8, 8)
    traces = np.arange(1280, dtype=np.int16).reshape(2, 8, 8, 10)
    volume = made(
        delta_tof_s=delta,
        slice_z_m=np.array([0.0, 0.01]),
        waveform=Waveform(traces, object_scale=np.ones((2, 8, 8))),
        sampling_rate_hz=1e6,
    )
    slice_data = volume.slice(1)
    assert (volume.slices, slice_data.slices) == (2, 1)
    np.testing.assert_array_equal(slice_data.delta_tof_s, delta[1])
    np.testing.assert_array_equal(slice_data.waveform.object, traces[1])
    assert slice_data.waveform.object_scale.shape == (8, 8)
    assert slice_data.waveform.scale == 1.0, "counts are pascals"
    with pytest.raises(InvalidInput, match="0 to 1"):
        volume.slice(2)


@pytest.mark.parametrize(
    ("fields", "field"),
    [
        ({"array_type": "spiral"}, "geometry@array_type"),
        ({"radius_m": 0.0}, "geometry@radius_m"),
        ({"sampling_rate_hz": -1.0}, "acquisition@sampling_rate_hz"),
        ({"center_frequency_hz": np.inf}, "acquisition@center_frequency_hz"),
        ({"amplitude_frequency_hz": np.nan}, "amplitude@frequency_hz"),
        ({"water_attenuation_np_m": -1.0}, "water@attenuation_np_m"),
        ({"t0_s": np.nan}, "acquisition@t0_s"),
        ({"wavelet": np.array([np.nan])}, "acquisition/wavelet"),
        ({"element_normal": np.zeros((8, 3))}, "geometry/element_normal"),
        ({"slice_z_m": np.array([0.0, 0.0])}, "slice/z_m"),
        ({"slice_z_m": np.array([0.0, 1.0])}, "traveltime/delta_tof_s"),
        ({"sigma_s": np.zeros((8, 8))}, "traveltime/sigma_s"),
        ({"log_ratio_np": np.full((8, 8), np.inf)}, "amplitude/log_ratio_np"),
        ({"valid": np.ones(8, dtype=bool)}, "mask/valid"),
        ({"waveform": Waveform(np.zeros((8, 8, 4), np.int16))}, "acquisition@sampling_rate_hz"),
    ],
)
def test_each_rule_names_its_field(fields, field):
    with pytest.raises(InvalidInput, match=f"^{field}: found"):
        made(**fields)


@pytest.mark.parametrize(
    ("build", "field"),
    [
        (lambda: Truth(np.ones(3), (1.0,), (0.0,)), "truth/sound_speed_mps"),
        (lambda: Truth(np.zeros((3, 3)), (1.0, 1.0), (0.0, 0.0)), "truth/sound_speed_mps"),
        (lambda: Truth(np.ones((3, 3)), (1.0,), (0.0, 0.0)), "truth@spacing_m"),
        (lambda: Truth(np.ones((3, 3)), (1.0, 0.0), (0.0, 0.0)), "truth@spacing_m"),
        (lambda: Truth(np.ones((3, 3)), (-1.0, 1.0), (0.0, 0.0)), "truth@spacing_m"),
        (lambda: Truth(np.ones((3, 3)), (1.0, 1.0), (0.0, np.nan)), "truth@origin_m"),
        (lambda: Waveform(np.zeros((2, 2), np.int16)), "waveform/object"),
        (lambda: Waveform(np.zeros((2, 2, 0), np.int16)), "waveform/object"),
        (lambda: Waveform(np.zeros((2, 0, 2), np.int16)), "waveform/object"),
        (lambda: Waveform(TRACES, np.zeros((2, 2, 3), np.int16)), "waveform/water"),
        (lambda: Waveform(TRACES, scale=np.nan), "waveform@scale"),
        (lambda: Waveform(TRACES, scale=0.0), "waveform@scale"),
        (lambda: Waveform(TRACES, object_scale=np.ones((2, 1))), "waveform/object_scale"),
        (lambda: Waveform(TRACES, water_scale=np.full((2, 2), np.inf)), "waveform/water_scale"),
        (lambda: Waveform(TRACES, water_scale=np.ones(2)), "waveform/water_scale"),
    ],
)
def test_truth_and_traces_keep_rules_too(build, field):
    with pytest.raises(InvalidInput) as refused:
        build()
    assert refused.value.field == field
    assert pickle.loads(pickle.dumps(refused.value)).field == field

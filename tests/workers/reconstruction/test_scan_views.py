"""The views of a scan: geometry, traces and picks are those of the dataset; a reduction keeps peaks."""

import base64
import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from bentray_kernels.acquisition import Waveform, pick
from bentray_kernels.errors import InvalidInput
from bentray_workers.files.dataset import write_dataset
from bentray_workers.reconstruction import scan_views
from bentray_workers.reconstruction.scan_views import (
    THUMBNAIL_PX,
    emission_traces,
    scan_geometry,
    scan_thumbnail,
)

from ...kernels.acquisition.traces import FREQUENCY_HZ, RATE_HZ, START_S, WATER_MPS, blob_delay, scan


def stored(folder, made):
    write_dataset(folder / "scan.h5", made)
    return folder / "scan.h5"


def decoded(view):
    values = np.frombuffer(base64.b64decode(view["traces"]), dtype="<f4")
    return values.reshape(view["receivers"], view["samples"])


def test_geometry_is_that_of_the_dataset(tmp_path):
    made = scan(elements=12)
    made = replace(made, tx=np.array([0, 4, 8]), waveform=Waveform(*(made.waveform.object[[0, 4, 8]],) * 2))
    view = scan_geometry(stored(tmp_path, made))
    np.testing.assert_array_equal(view["position_m"], made.element_position_m)
    assert np.flatnonzero(view["emits"]).tolist() == [0, 4, 8]
    assert view["receives"] == [True] * 12
    assert (view["every"], view["pairs"], view["timed_pairs"]) == (1, 33, None)
    assert (view["center_frequency_hz"], view["frequency_estimated"]) == (FREQUENCY_HZ, False)
    assert (view["sampling_rate_hz"], view["t0_s"]) == (RATE_HZ, START_S)
    assert view["samples"] == made.waveform.object.shape[-1]
    assert view["water_speed_mps"] == WATER_MPS


def test_an_unknown_frequency_is_estimated_and_said_to_be(tmp_path):
    view = scan_geometry(stored(tmp_path, replace(scan(elements=8), center_frequency_hz=None)))
    assert view["frequency_estimated"]
    assert view["center_frequency_hz"] == pytest.approx(FREQUENCY_HZ, rel=0.2)


def test_of_many_elements_every_nth_is_listed(tmp_path, monkeypatch):
    made = scan(elements=12)
    monkeypatch.setattr(scan_views, "MAX_ELEMENTS", 5)
    view = scan_geometry(stored(tmp_path, made))
    assert view["every"] == 3
    np.testing.assert_array_equal(view["position_m"], made.element_position_m[::3])


@pytest.mark.parametrize("quantity", ["object", "water"])
def test_traces_are_those_of_the_dataset_divided_by_their_peak(tmp_path, quantity):
    made = scan(blob_delay(12), elements=12, gain=3.0)
    view = emission_traces(stored(tmp_path, made), emission=5, index=0, what=quantity)
    shot = getattr(made.waveform, quantity)[5]
    shot = shot - np.median(shot, axis=1, keepdims=True)
    np.testing.assert_allclose(decoded(view), shot / np.abs(shot).max(axis=1, keepdims=True), atol=1e-6)
    assert (view["first_s"], view["step_s"]) == (START_S, 1.0 / RATE_HZ)
    assert (view["element"], view["receiver_element"]) == (5, list(range(12)))
    distance = np.linalg.norm(made.element_position_m - made.element_position_m[5], axis=1)
    np.testing.assert_allclose(view["straight_s"], distance / WATER_MPS, atol=1e-12)


def test_a_slice_is_read_by_its_index(tmp_path):
    dataset = scan(elements=8)
    late = [np.stack([t, np.roll(t, 9, axis=-1)]) for t in (dataset.waveform.object, dataset.waveform.water)]
    path = stored(tmp_path, replace(dataset, slice_z_m=np.array([0.0, 0.01]), waveform=Waveform(*late)))
    first, second = (decoded(emission_traces(path, emission=1, index=k, what="object")) for k in (0, 1))
    np.testing.assert_allclose(second[:, 9:], first[:, :-9], atol=1e-6)
    assert not np.array_equal(first, second)


def test_fewer_samples_keep_the_peak_with_its_sign(tmp_path, monkeypatch):
    made = scan(elements=8)
    received = np.zeros_like(made.waveform.object)
    received[:, :, 101] = -2.0
    received[:, :, 203] = 1.0
    path = stored(tmp_path, replace(made, waveform=Waveform(received, made.waveform.water)))
    monkeypatch.setattr(scan_views, "MAX_SAMPLES", 40)
    monkeypatch.setattr(scan_views, "MAX_RECEIVERS", 4)
    view = emission_traces(path, emission=0, index=0, what="object")
    block = round(view["step_s"] * RATE_HZ)
    assert block > 1
    assert (view["receivers"], view["receiver_element"]) == (4, [0, 2, 4, 6])
    assert view["samples"] <= 40
    values = decoded(view)
    assert (values[:, 101 // block] == -1.0).all()
    assert (values[:, 203 // block] == 0.5).all()
    assert np.count_nonzero(values) == 8


def test_picks_are_those_of_the_picker(tmp_path):
    made = scan(blob_delay(16), elements=16, noise=0.01)
    view = emission_traces(stored(tmp_path, made), emission=3, index=0, what="object")
    assert view["picker"] == "aic"
    computed = np.array([np.nan if one is None else one for one in view["pick_s"]])
    expected = np.asarray(view["straight_s"]) + pick(made, "aic").delta_tof_s[3]
    both = np.isfinite(computed) & np.isfinite(expected)
    assert both.sum() >= 12
    np.testing.assert_allclose(computed[both], expected[both], atol=1e-12)
    assert view["pick_s"][3] is None


def test_without_a_water_shot_there_are_no_picks(tmp_path):
    made = scan(elements=8)
    path = stored(tmp_path, replace(made, waveform=Waveform(made.waveform.object, None)))
    assert emission_traces(path, emission=0, index=0, what="object")["pick_s"] is None
    with pytest.raises(InvalidInput, match=r"quantity.*'water'.*accepted: object"):
        emission_traces(path, emission=0, index=0, what="water")


def test_slices_without_a_frequency_have_picks(tmp_path):
    one = scan(blob_delay(16), elements=16, noise=0.01)
    both = [np.stack([t, t]) for t in (one.waveform.object, one.waveform.water)]
    made = replace(one, slice_z_m=np.array([0.0, 0.01]), waveform=Waveform(*both), center_frequency_hz=None)
    path = stored(tmp_path, made)
    assert scan_geometry(path)["frequency_estimated"]
    traces = emission_traces(path, emission=3, index=1, what="object")["pick_s"]
    assert sum(one is not None for one in traces) >= 12


def test_silent_traces_have_no_frequency_and_no_picks(tmp_path):
    made = scan(elements=8)
    silent = Waveform(*(np.zeros_like(made.waveform.object) for _ in range(2)))
    path = stored(tmp_path, replace(made, waveform=silent, center_frequency_hz=None))
    view = scan_geometry(path)
    assert (view["center_frequency_hz"], view["frequency_estimated"]) == (None, False)
    view = emission_traces(path, emission=0, index=0, what="object")
    assert not decoded(view).any()
    assert view["pick_s"] is None


def test_a_thumbnail_shows_travel_times_else_traces(tmp_path):
    def drawn(made):
        picture = Image.open(io.BytesIO(scan_thumbnail(stored(tmp_path, made))))
        assert picture.size == (THUMBNAIL_PX, THUMBNAIL_PX)
        return np.asarray(picture)[..., 0].astype(float)

    made = scan(blob_delay(12), elements=12)
    times = np.linspace(0.0, 1e-6, 144).reshape(12, 12)
    times[3, 5] = np.nan
    picked = drawn(replace(made, waveform=None, delta_tof_s=times))
    assert picked[0, 9] < 10 < 245 < picked[-1, -10]
    # The pair without a time, and an element with itself.
    assert picked[26, 43] == picked[0, 0] == scan_views.MISSING != picked[26, 52]
    # The arrival at each receiver is later, the farther it is from the emitter.
    first = (drawn(made) > 80.0).argmax(axis=0)
    assert first[48] > first[24] > first[8]

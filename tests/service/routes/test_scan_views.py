"""/v1/datasets/{id}/geometry and /traces: values of the file, by a worker; and every way of being refused."""

import base64

import h5py
import numpy as np
import pytest

from bentray_workers.files.dataset import write_dataset

from ...kernels.acquisition.traces import WATER_MPS, blob_delay, scan

HDF5 = {"Content-Type": "application/x-hdf5"}


@pytest.fixture
def traced(tmp_path):
    """A scan of 12 elements with traces of the object and of water, and its address in a service."""
    made = scan(blob_delay(12), elements=12, noise=0.01)
    write_dataset(tmp_path / "traced.h5", made)
    content = (tmp_path / "traced.h5").read_bytes()
    return made, lambda http: http.post("/v1/datasets", content=content, headers=HDF5).json()["links"]["self"]


def test_geometry_of_a_scan_with_times(http, cluster, uploaded, scan):
    body = http.get(f"/v1/datasets/{uploaded(http)}/geometry").json()
    with h5py.File(scan(name="same.h5")) as file:
        np.testing.assert_array_equal(body["position_m"], file["geometry/element_position_m"])
    assert (body["array_type"], body["radius_m"], body["every"]) == ("ring", 0.05, 1)
    assert (body["pairs"], body["timed_pairs"], body["samples"]) == (240, 240, 0)
    assert (body["center_frequency_hz"], body["frequency_estimated"]) == (1e6, False)
    assert (body["water_speed_mps"], body["water_assumed"]) == (1500.0, False)
    assert cluster.submitted[-1]["resources"] == {"render": 1}


def test_invalid_pairs_are_not_counted(start, scan):
    def change(file):
        valid = np.ones((16, 16), dtype=bool)
        valid[2, 5:9] = False
        file["mask/valid"] = valid

    http = start()
    here = http.post("/v1/datasets", content=scan(change).read_bytes(), headers=HDF5).json()["links"]["self"]
    body = http.get(f"{here}/geometry").json()
    assert (body["pairs"], body["timed_pairs"]) == (240, 236)


def test_assumed_water_is_said_to_be(start, scan):
    def change(file):
        file["water"].attrs["temperature_assumed"] = 1

    http = start()
    here = http.post("/v1/datasets", content=scan(change).read_bytes(), headers=HDF5).json()["links"]["self"]
    assert http.get(f"{here}/geometry").json()["water_assumed"] is True


def test_traces_and_picks(start, cluster, traced):
    made, upload = traced
    http = start()
    body = http.get(f"{upload(http)}/traces?emission=7&slice=0&quantity=object").json()
    values = np.frombuffer(base64.b64decode(body["traces"]), dtype="<f4")
    values = values.reshape(body["receivers"], body["samples"])
    shot = made.waveform.object[7]
    shot = shot - np.median(shot, axis=1, keepdims=True)
    np.testing.assert_allclose(values, shot / np.abs(shot).max(axis=1, keepdims=True), atol=1e-6)
    assert (body["emission"], body["element"], body["quantity"]) == (7, 7, "object")
    distance = np.linalg.norm(made.element_position_m - made.element_position_m[7], axis=1)
    np.testing.assert_allclose(body["straight_s"], distance / WATER_MPS, atol=1e-12)
    assert body["picker"] == "aic"
    late = np.array([np.nan if one is None else one for one in body["pick_s"]]) - body["straight_s"]
    finite = np.isfinite(late)
    assert finite.sum() >= 9
    # Picks are good to a fraction of the period of 1 µs.
    np.testing.assert_allclose(late[finite], blob_delay(12)[7][finite], atol=0.2e-6)
    assert cluster.submitted[-1]["resources"] == {"render": 1}


@pytest.mark.parametrize(
    ("query", "field", "accepted"),
    [
        ("emission=12", "emission", "0 to 11"),
        ("slice=1", "slice", "0 to 0"),
    ],
)
def test_names_the_wrong_parameter_and_what_is_accepted(http, traced, query, field, accepted):
    answer = http.get(f"{traced[1](http)}/traces?{query}")
    assert answer.status_code == 422
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["field"] == field
    assert accepted in answer.json()["accepted"]


def test_a_scan_without_traces_says_so(http, uploaded):
    answer = http.get(f"/v1/datasets/{uploaded(http)}/traces")
    assert (answer.status_code, answer.json()["field"]) == (422, "quantity")
    assert "no traces" in answer.json()["found"]

"""/v1/datasets/{id}/geometry, /traces and /quality: values of the file, by a worker; and every refusal."""

import base64
import time
from typing import get_args

import h5py
import numpy as np
import pytest

from bentray_kernels.acquisition import PICKERS
from bentray_service.routes.datasets import Picker
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


@pytest.fixture
def faulty(tmp_path):
    """A scan whose element 5 does not receive."""
    made = scan(blob_delay(16), elements=16, noise=0.01)
    made.waveform.object[:, 5] = made.waveform.water[:, 5] = 0.0
    write_dataset(tmp_path / "faulty.h5", made)
    return (tmp_path / "faulty.h5").read_bytes()


def test_report_and_page(http, cluster, faulty):
    here = http.post("/v1/datasets", content=faulty, headers=HDF5).json()["links"]["self"]
    body = http.get(f"{here}/quality").json()
    assert body["verdict"] == "usable"
    assert body["picker"] == "aic"
    (dead,) = (f for f in body["findings"] if f["check"] == "dead elements")
    assert (dead["elements"], dead["role"], dead["action"]) == ([5], "reception", "left out")
    assert dead["pair_count"] == 16
    assert cluster.submitted[-1]["resources"] == {"render": 1}
    page = http.get(f"{here}/quality.png?picker=correlation")
    assert page.headers["content-type"] == "image/png"
    assert page.content.startswith(b"\x89PNG")
    again = http.get(
        f"{here}/quality.png?picker=correlation", headers={"If-None-Match": page.headers["etag"]}
    )
    assert again.status_code == 304
    assert http.get(f"{here}/quality.png").headers["etag"] != page.headers["etag"]
    assert http.head(f"{here}/quality.png").status_code == 200


def test_a_report_is_kept_until_the_water_changes_or_the_scan_is_deleted(http, cluster, faulty):
    here = http.post("/v1/datasets", content=faulty, headers=HDF5).json()["links"]["self"]
    first = http.get(f"{here}/quality").json()
    count = len(cluster.submitted)
    assert http.get(f"{here}/quality").json() == first
    assert len(cluster.submitted) == count
    for changes, more in (({"water_temperature_c": 31.0}, 1), ({"water_temperature_c": None}, 0)):
        http.patch(here, json=changes)
        count = len(cluster.submitted)
        assert http.get(f"{here}/quality").status_code == 200
        assert len(cluster.submitted) == count + more
    reports = next(http.app.state.stores.files.root.glob("tenants/*/reports"))
    assert len(list(reports.iterdir())) == 2
    assert http.delete(here).status_code == 204
    assert list(reports.iterdir()) == []


def test_a_large_scan_is_examined_when_it_is_stored(start, cluster, faulty, monkeypatch):
    monkeypatch.setattr("bentray_service.pictures.EXAMINED_S", 0.0)
    http = start()
    here = http.post("/v1/datasets", content=faulty, headers=HDF5).json()["links"]["self"]
    until = time.monotonic() + 60.0
    while not list(http.app.state.stores.files.root.glob("tenants/*/reports/*.json")):
        assert time.monotonic() < until
        time.sleep(0.02)
    count = len(cluster.submitted)
    assert http.get(f"{here}/quality").json()["verdict"] == "usable"
    assert len(cluster.submitted) == count


def test_a_scan_with_times_alone(http, uploaded):
    body = http.get(f"/v1/datasets/{uploaded(http)}/quality").json()
    assert "sampling rate" not in body["checked"]
    assert "outliers" in body["checked"]


def test_a_refused_scan_has_its_report_too(start, tmp_path):
    made = scan(elements=12)
    np.asarray(made.waveform.water)[:] = 0.0
    write_dataset(tmp_path / "silent.h5", made)
    http = start()
    content = (tmp_path / "silent.h5").read_bytes()
    here = http.post("/v1/datasets", content=content, headers=HDF5).json()["links"]["self"]
    body = http.get(f"{here}/quality").json()
    assert (body["verdict"], body["usable_pairs"]) == ("refused", 0)
    assert "refused" in {finding["action"] for finding in body["findings"]}
    assert http.get(f"{here}/quality.png").status_code == 200


def test_every_picker_can_be_requested():
    assert get_args(get_args(Picker)[0]) == tuple(PICKERS)

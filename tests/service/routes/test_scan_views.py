"""/v1/datasets/{id}/geometry, /traces and /quality: values of the file, by a worker; and every refusal."""

import base64
from typing import get_args

import h5py
import numpy as np
import pytest

from bentray_kernels.acquisition import PICKERS
from bentray_service.routes.datasets import Picker
from bentray_workers.files.dataset import write_dataset

from ...kernels.acquisition.traces import WATER_MPS, blob_delay, scan
from ...waiting import wait_until
from ..conftest import STREAM, refused


def sent(http, path):
    """The address of a scan in a service."""
    return http.post("/v1/datasets", content=path.read_bytes(), headers=STREAM).json()["links"]["self"]


@pytest.fixture
def traced(tmp_path):
    """A scan of 12 elements with traces of the object and of water, and its file."""
    made = scan(blob_delay(12), elements=12, noise=0.01)
    write_dataset(tmp_path / "traced.h5", made)
    return made, tmp_path / "traced.h5"


def test_geometry_of_a_scan_with_times(http, cluster, uploaded, scan):
    body = http.get(f"/v1/datasets/{uploaded(http)}/geometry").json()
    with h5py.File(scan(name="same.h5")) as file:
        np.testing.assert_array_equal(body["position_m"], file["geometry/element_position_m"])
    assert (body["array_type"], body["radius_m"], body["every"]) == ("ring", 0.05, 1)
    assert (body["pairs"], body["timed_pairs"], body["samples"]) == (240, 240, 0)
    assert (body["center_frequency_hz"], body["frequency_estimated"]) == (1e6, False)
    assert (body["water_speed_mps"], body["water_assumed"]) == (1500.0, False)
    assert cluster.submitted[-1]["resources"] == {"render": 1}


def test_invalid_pairs_and_assumed_water_are_said_to_be(http, scan):
    def change(file):
        valid = np.ones((16, 16), dtype=bool)
        valid[2, 5:9] = False
        file["mask/valid"] = valid
        file["water"].attrs["temperature_assumed"] = 1

    body = http.get(f"{sent(http, scan(change))}/geometry").json()
    assert (body["pairs"], body["timed_pairs"], body["water_assumed"]) == (240, 236, True)


def test_traces_and_picks(http, cluster, traced):
    made, path = traced
    body = http.get(f"{sent(http, path)}/traces?emission=7&slice=0&quantity=object").json()
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


def test_names_the_wrong_parameter_and_what_is_accepted(http, traced, uploaded):
    here = sent(http, traced[1])
    refused(http.get(f"{here}/traces?emission=12"), "emission", "0 to 11")
    refused(http.get(f"{here}/traces?slice=1"), "slice", "0 to 0")
    without = http.get(f"/v1/datasets/{uploaded(http)}/traces")
    assert "no traces" in refused(without, "quantity")["found"]


def test_a_thumbnail_is_drawn_once_and_kept(http, cluster, uploaded):
    here = http.get(f"/v1/datasets/{uploaded(http)}").json()["links"]["thumbnail"]
    first = http.get(here)
    assert (first.headers["content-type"], first.content[:4]) == ("image/png", b"\x89PNG")
    count = len(cluster.submitted)
    assert http.get(here).content == first.content
    assert len(cluster.submitted) == count


@pytest.fixture
def faulty(tmp_path, http):
    """The address of a scan whose element 5 does not receive."""
    made = scan(blob_delay(16), elements=16, noise=0.01)
    made.waveform.object[:, 5] = made.waveform.water[:, 5] = 0.0
    write_dataset(tmp_path / "faulty.h5", made)
    return sent(http, tmp_path / "faulty.h5")


def test_report_and_page(http, cluster, faulty):
    body = http.get(f"{faulty}/quality").json()
    assert body["verdict"] == "usable"
    assert body["picker"] == "aic"
    (dead,) = (f for f in body["findings"] if f["check"] == "dead elements")
    assert (dead["elements"], dead["role"], dead["action"]) == ([5], "reception", "left out")
    assert dead["pair_count"] == 16
    assert cluster.submitted[-1]["resources"] == {"render": 1}
    page = http.get(f"{faulty}/quality.png?picker=correlation")
    assert page.headers["content-type"] == "image/png"
    assert page.content.startswith(b"\x89PNG")
    tag = {"If-None-Match": page.headers["etag"]}
    assert http.get(f"{faulty}/quality.png?picker=correlation", headers=tag).status_code == 304
    assert http.get(f"{faulty}/quality.png").headers["etag"] != page.headers["etag"]
    assert http.head(f"{faulty}/quality.png").status_code == 200


def test_a_report_is_kept_until_the_water_changes_or_the_scan_is_deleted(http, cluster, faulty):
    first = http.get(f"{faulty}/quality").json()
    count = len(cluster.submitted)
    assert http.get(f"{faulty}/quality").json() == first
    assert len(cluster.submitted) == count
    for changes, more in (({"water_temperature_c": 31.0}, 1), ({"water_temperature_c": None}, 0)):
        http.patch(faulty, json=changes)
        count = len(cluster.submitted)
        assert http.get(f"{faulty}/quality").status_code == 200
        assert len(cluster.submitted) == count + more
    reports = next(http.app.state.stores.files.root.glob("tenants/*/reports"))
    assert len(list(reports.iterdir())) == 2
    assert http.delete(faulty).status_code == 204
    assert list(reports.iterdir()) == []


@pytest.fixture
def examined_at_once(monkeypatch):
    monkeypatch.setattr("bentray_service.pictures.EXAMINED_S", 0.0)


def test_a_large_scan_is_examined_when_it_is_stored(examined_at_once, http, cluster, faulty):
    wait_until(lambda: list(http.app.state.stores.files.root.glob("tenants/*/reports/*.json")))
    count = len(cluster.submitted)
    assert http.get(f"{faulty}/quality").json()["verdict"] == "usable"
    assert len(cluster.submitted) == count


def test_a_scan_with_times_alone(http, uploaded):
    body = http.get(f"/v1/datasets/{uploaded(http)}/quality").json()
    assert "sampling rate" not in body["checked"]
    assert "outliers" in body["checked"]


def test_a_refused_scan_has_its_report_too(http, tmp_path):
    made = scan(elements=12)
    np.asarray(made.waveform.water)[:] = 0.0
    write_dataset(tmp_path / "silent.h5", made)
    here = sent(http, tmp_path / "silent.h5")
    body = http.get(f"{here}/quality").json()
    assert (body["verdict"], body["usable_pairs"]) == ("refused", 0)
    assert "refused" in {finding["action"] for finding in body["findings"]}
    assert http.get(f"{here}/quality.png").status_code == 200


def test_every_picker_can_be_requested():
    assert get_args(get_args(Picker)[0]) == tuple(PICKERS)

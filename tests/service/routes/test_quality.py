"""/v1/datasets/{id}/quality: the report and the page, by a worker; and every way of being refused."""

import time
from typing import get_args

import numpy as np
import pytest

from bentray_kernels.acquisition import PICKERS
from bentray_service.routes.datasets import Picker
from bentray_workers.files.dataset import write_dataset

from ...kernels.acquisition.traces import blob_delay, scan

HDF5 = {"Content-Type": "application/x-hdf5"}


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

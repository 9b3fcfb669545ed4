"""POST of /v1/datasets/{id}/corrections: a corrected copy; the scan and its results stay; refusals."""

import hashlib
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import get_args

import numpy as np
import pytest

from bentray_service.access.audit import entries
from bentray_service.routes.models.name_changes import LengthUnit, TimeUnit
from bentray_service.rows.ids import Tenant
from bentray_service.rows.stored_tables import Datasets
from bentray_workers.files.dataset import read_dataset
from bentray_workers.files.dataset.units import POSITION_UNITS, TIME_UNITS

from ..conftest import STREAM, refused

pytestmark = pytest.mark.usefixtures("work")

WRONG = {"times_in": "ms", "times_read_as": "us"}


def in_microseconds(file):
    """The times of the small scan, a thousandth of what they are."""
    file["traveltime/delta_tof_s"][...] *= 1e-3


@pytest.fixture
def here(http, scan):
    answer = http.post("/v1/datasets", content=scan(in_microseconds).read_bytes(), headers=STREAM)
    return answer.json()["links"]["self"]


def downloaded(http, here, path):
    path.write_bytes(http.get(f"{here}/file").content)
    return read_dataset(path)


def test_units_are_those_of_the_workers():
    assert get_args(TimeUnit) == tuple(TIME_UNITS)
    assert get_args(LengthUnit) == tuple(POSITION_UNITS)


@pytest.mark.ingest_process
def test_the_copy_is_a_scan_of_its_own_and_the_scan_stays(http, here, tmp_path, submitted, until):
    job = until(http, submitted(http, here.rpartition("/")[2])["id"])
    http.patch(here, json={"title": "Left", "notes": "Second visit", "water_temperature_c": 31.5})
    before, file = http.get(here).json(), http.get(f"{here}/file").content
    answer = http.post(f"{here}/corrections", json={**WRONG, "frequency_hz": 500000})
    assert answer.status_code == 201, answer.text
    made = answer.json()
    assert answer.headers["location"] == made["links"]["self"] != here
    assert (made["title"], made["water_temperature_c"]) == ("Left, corrected", 31.5)
    stated = f"Corrected copy of {before['id']}: times in ms, read as us before (x 1000), frequency 500000 Hz"
    assert made["notes"] == f"{stated}\nSecond visit"
    assert made["source"] == stated
    # A result still belongs to the scan that it was made of.
    assert (http.get(here).json(), http.get(f"{here}/file").content) == (before, file)
    assert http.get(job["links"]["volume"]).json()["dataset"] == before["id"]
    wrong, right = (
        downloaded(http, here, tmp_path / "a.h5"),
        downloaded(http, made["links"]["self"], tmp_path / "b.h5"),
    )
    np.testing.assert_allclose(right.delta_tof_s, 1e3 * wrong.delta_tof_s)
    assert (wrong.center_frequency_hz, right.center_frequency_hz, right.source) == (1e6, 5e5, stated)
    content = (tmp_path / "b.h5").read_bytes()
    assert (made["bytes"], made["sha256"]) == (len(content), hashlib.sha256(content).hexdigest())
    assert [one["id"] for one in http.get("/v1/datasets").json()["datasets"]] == [made["id"], before["id"]]


def test_the_geometry_proposes_the_correction(http, here):
    (proposal,) = http.get(f"{here}/geometry").json()["proposed_corrections"]
    assert (proposal["what"], proposal["unit"], proposal["read_as"]) == ("times", "ms", "us")
    made = http.post(
        f"{here}/corrections", json={"times_in": proposal["unit"], "times_read_as": proposal["read_as"]}
    ).json()
    assert http.get(f"{made['links']['self']}/geometry").json()["proposed_corrections"] == []


@pytest.mark.parametrize(
    ("wrong", "field", "accepted"),
    [
        ({}, "correction", "times_in or positions_in"),
        ({"temperature": 20}, "temperature", "no such field"),
        ({"positions_in": "um"}, "geometry/element_position_m", "m"),
        ({"times_in": "s", "times_read_as": "us"}, "traveltime/delta_tof_s", "300 to 6000 m/s"),
    ],
)
def test_refusals_name_field_and_accepted_values_and_leave_nothing(http, here, wrong, field, accepted):
    refused(http.post(f"{here}/corrections", json=wrong), field, accepted)
    assert len(http.get("/v1/datasets").json()["datasets"]) == 1
    folder = http.app.state.stores.files.of(Tenant("local")).root
    assert len(list((folder / "datasets").iterdir())) == 1
    assert list((folder / "incoming").iterdir()) == []


def test_the_quota_holds(start, scan, uploaded, work):
    http = start(max_tenant_bytes=2 * scan().stat().st_size)
    here = f"/v1/datasets/{uploaded(http)}"
    statuses = [http.post(f"{here}/corrections", json={"frequency_hz": 5e5}).status_code for _ in range(5)]
    assert set(statuses) <= {201, 507}
    assert statuses[-1] == 507
    assert len(http.get("/v1/datasets").json()["datasets"]) == 1 + statuses.count(201)


def copies_of(http, here):
    return [one for one in http.get("/v1/datasets").json()["datasets"] if one["links"]["self"] != here]


def test_a_repeated_request_makes_no_second_copy(http, here, scan):
    key = {"Idempotency-Key": "scan 7, first try"}
    first, again = (http.post(f"{here}/corrections", json=WRONG, headers=key) for _ in range(2))
    assert (first.status_code, again.status_code) == (201, 201)
    assert again.json() == first.json()
    assert again.headers["location"] == first.headers["location"]
    assert [one.headers.get("idempotency-replayed") for one in (first, again)] == [None, "true"]
    assert [one["id"] for one in copies_of(http, here)] == [first.json()["id"]]
    other = http.post(f"{here}/corrections", json={**WRONG, "frequency_hz": 5e5}, headers=key)
    refused(other, "Idempotency-Key", status=409)
    # One that has been deleted is made again, and without a key each request makes its own.
    http.delete(first.json()["links"]["self"])
    for headers in (key, {}, {}):
        assert http.post(f"{here}/corrections", json=WRONG, headers=headers).status_code == 201
    assert len(copies_of(http, here)) == 3


def test_equal_requests_at_once_make_one_copy(http, here, monkeypatch):
    """Both have written their file before one of them has a row."""
    both, plain = threading.Barrier(2), Datasets.add_once

    def together(*given, **named):
        both.wait(60.0)
        return plain(*given, **named)

    monkeypatch.setattr(Datasets, "add_once", together)
    key = {"Idempotency-Key": "k"}
    with ThreadPoolExecutor(2) as pool:
        sent = [pool.submit(http.post, f"{here}/corrections", json=WRONG, headers=key) for _ in range(2)]
        answers = [one.result() for one in sent]
    assert [one.status_code for one in answers] == [201, 201]
    (made,) = copies_of(http, here)
    assert {one.json()["id"] for one in answers} == {made["id"]}
    folder = http.app.state.stores.files.of(Tenant("local")).root
    sizes = [path.stat().st_size for path in (folder / "datasets").iterdir()]
    assert len(sizes) == 2
    usage = http.app.state.stores.quota.of(Tenant("local"))
    assert (usage.stored, usage.reserved) == (sum(sizes), 0)


def test_corrections_are_audited(http, here):
    """Done and refused ones, with the ids of the scan and of its copy."""
    copy = http.post(f"{here}/corrections", json=WRONG).json()["id"]
    http.post(f"{here}/corrections", json={"times_in": "min"})
    route, scan = "/v1/datasets/{dataset_id}/corrections", here.rpartition("/")[2]
    audited = [one for one in entries(http.app.state.stores.files.audit) if one["route"] == route]
    assert [(one["method"], one["ids"], one["status"]) for one in audited] == [
        ("POST", [scan, copy], 201),
        ("POST", [scan], 422),
    ]

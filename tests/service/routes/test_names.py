"""PATCH of datasets and jobs: names, notes and stated water; what is refused; the place in the queue."""

from itertools import product

import pytest

from bentray_kernels.acquisition import speed_from_temperature
from bentray_service.rows.keys import ApiKey

from ..conftest import refused

pytestmark = pytest.mark.usefixtures("work")


@pytest.fixture
def dataset(http, uploaded):
    return uploaded(http)


def test_a_scan_is_named_and_its_name_taken_back(http, dataset):
    here = f"/v1/datasets/{dataset}"
    before = http.get(here).json()
    named = http.patch(here, json={"title": "Left, 31 °C", "notes": "Water\nfrom the tap"})
    assert (named.status_code, named.json()["title"], named.json()["notes"]) == (
        200,
        "Left, 31 °C",
        "Water\nfrom the tap",
    )
    assert http.get("/v1/datasets").json()["datasets"] == [named.json()]
    assert http.patch(here, json={"title": "", "notes": None}).json() == {
        **before,
        "notes": "Water\nfrom the tap",
    }


def test_a_job_is_named_in_any_state(http, dataset, submitted, until, work):
    work.hold.clear()
    job = submitted(http, dataset)
    here = job["links"]["self"]
    until(http, job["id"], "running")
    assert http.patch(here, json={"name": "Trial"}).json()["name"] == "Trial"
    work.hold.set()
    until(http, job["id"])
    named = http.patch(here, json={"notes": "Sharp"}).json()
    assert (named["name"], named["notes"], named["state"]) == ("Trial", "Sharp", "succeeded")
    assert http.get("/v1/jobs").json()["jobs"][0]["name"] == "Trial"


def test_a_result_has_the_name_of_its_scan(http, dataset, submitted, until):
    volume = until(http, submitted(http, dataset)["id"])["links"]["volume"]
    before = http.get(volume).json()["title"]
    http.patch(f"/v1/datasets/{dataset}", json={"title": "Left"})
    assert http.get(volume).json()["title"] == "Left"
    http.patch(f"/v1/datasets/{dataset}", json={"title": ""})
    assert http.get(volume).json()["title"] == before


def test_wrong_changes_are_refused_by_name(http, dataset, submitted):
    job = submitted(http, dataset)["id"]
    items = ((f"/v1/datasets/{dataset}", "title"), (f"/v1/jobs/{job}", "name"))
    wrong = (
        ({"{name}": 201 * "x"}, "{name}", "at most 200 characters"),
        ({"notes": 4001 * "x"}, "notes", "at most 4000 characters"),
        ({"notes": "a\x00b"}, "notes", "match"),
        ({"{name}": 7}, "{name}", "string"),
        ({"colour": "red"}, "colour", "no such field; see /docs"),
        ([], "body", "a JSON object"),
    )
    for (here, name), (changes, field, accepted) in product(items, wrong):
        given = {key.format(name=name): value for key, value in changes.items()} if changes else changes
        before = http.get(here).json()
        refused(http.patch(here, json=given), field.format(name=name), accepted)
        after = http.get(here).json()
        assert (after[name], after["notes"]) == (before[name], before["notes"])


def test_longest_name_and_notes_are_kept(http, dataset):
    longest = {"title": 200 * "ä", "notes": 4000 * "ö"}
    answer = http.patch(f"/v1/datasets/{dataset}", json=longest).json()
    assert {name: answer[name] for name in longest} == longest


def test_other_bodies_and_unknown_ids(http, dataset):
    here = f"/v1/datasets/{dataset}"
    assert http.patch(here, content=b"{}", headers={"Content-Type": "text/plain"}).status_code == 415
    assert http.patch(here, json={"notes": 2**20 * "x"}).status_code == 413
    for unknown in (f"/v1/datasets/ds-{20 * '0'}", f"/v1/jobs/job-{20 * '0'}"):
        assert http.patch(unknown, json={"notes": "x"}).status_code == 404


def test_the_place_of_a_queued_job(start, uploaded, submitted):
    # Jobs stay where they are: no disk has so much room.
    http = start(min_free_bytes=2**60)
    dataset = uploaded(http)
    queued = [submitted(http, dataset) for _ in range(3)]
    assert [job["ahead"] for job in queued] == [0, 1, 2]
    http.post(queued[1]["links"]["cancel"]).raise_for_status()
    places = [http.get(f"/v1/jobs/{job['id']}").json()["ahead"] for job in queued]
    assert places == [0, None, 1]
    assert {job["ahead"] for job in http.get("/v1/jobs").json()["jobs"]} == {None}


def test_the_key_that_started_a_job_is_told(start, uploaded, submitted, tmp_path):
    key = ApiKey.new()
    file = tmp_path / "key"
    file.touch(0o600)
    file.write_text(key.shown())
    http = start(first_key_file=file, min_free_bytes=2**60)
    http.headers["Authorization"] = f"Bearer {key.shown()}"
    assert submitted(http, uploaded(http))["started_by"] == key.id


@pytest.fixture
def here(http, uploaded):
    return f"/v1/datasets/{uploaded(http)}"


def state(http, here, celsius):
    answer = http.patch(here, json={"water_temperature_c": celsius})
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_the_scan_keeps_its_file_and_tells_both(http, here):
    before, file = http.get(here).json(), http.get(f"{here}/file").content
    assert before["water_temperature_c"] is None
    stated = state(http, here, 31.5)
    assert stated == {**before, "water_temperature_c": 31.5}
    geometry = http.get(f"{here}/geometry").json()
    assert geometry["water_speed_mps"] == speed_from_temperature(31.5)
    assert (geometry["water_temperature_c"], geometry["water_assumed"]) == (31.5, False)
    assert "1500.0 m/s" in geometry["water_in_file"]
    assert http.get(f"{here}/file").content == file
    # A name changes nothing else; null takes the statement back.
    assert http.patch(here, json={"title": "Left"}).json()["water_temperature_c"] == 31.5
    http.patch(here, json={"title": ""})
    assert state(http, here, None) == before
    assert http.get(f"{here}/geometry").json()["water_speed_mps"] == 1500.0


def test_later_jobs_take_it_unless_they_state_their_own(http, here, submitted, until, work):
    dataset = here.rpartition("/")[2]
    first = submitted(http, dataset)
    state(http, here, 31.5)
    second, third = submitted(http, dataset), submitted(http, dataset, water_temperature_c=25.0)
    state(http, here, None)
    for job, expected in ((first, None), (second, 31.5), (third, 25.0)):
        ended = until(http, job["id"])
        assert ended["settings"]["water_temperature_c"] == job["settings"]["water_temperature_c"] == expected
    assert sorted(call[1].water_temperature_c or 0.0 for call in work.calls) == [0.0, 25.0, 31.5]


def test_another_water_is_another_picture(http, here):
    before = http.get(f"{here}/quality.png")
    state(http, here, 31.5)
    after = http.get(f"{here}/quality.png", headers={"If-None-Match": before.headers["etag"]})
    assert after.status_code == 200


@pytest.mark.parametrize("wrong", [-0.1, 95.1, "warm", True, "31"])
def test_a_temperature_without_a_speed_is_rejected(http, here, wrong):
    refused(http.patch(here, json={"water_temperature_c": wrong}), "water_temperature_c")
    assert http.get(here).json()["water_temperature_c"] is None

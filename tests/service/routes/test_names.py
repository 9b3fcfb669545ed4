"""PATCH of datasets and jobs: names and notes; what is refused; the place in the queue."""

from itertools import product

import pytest

from bentray_service.rows.keys import ApiKey

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
        answer = http.patch(here, json=given)
        body = answer.json()
        assert (answer.status_code, body["field"]) == (422, field.format(name=name))
        assert accepted in body["accepted"]
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

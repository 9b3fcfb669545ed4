"""/v1/batches: many scans as one job with one progress, which survives a restart and one failed scan."""

import pytest

SART = {"method": "sart", "nodes": 16, "iterations": 2}


@pytest.fixture
def scans(scan):
    """Upload different scans; returns their ids."""

    def send(http, number=3):
        ids = []
        for one in range(number):
            path = scan(lambda file, one=one: file.attrs.update(title=f"Scan {one}"), f"{one}.h5")
            answer = http.post(
                "/v1/datasets", content=path.read_bytes(), headers={"Content-Type": "application/x-hdf5"}
            )
            ids.append(answer.json()["id"])
        return ids

    return send


def ended(http, batch, until):
    for job in batch["jobs"]:
        until(http, job["id"])
    return http.get(batch["links"]["self"]).json()


def test_many_scans_as_one(http, scans, work, until):
    datasets = scans(http)
    answer = http.post("/v1/batches", json={"datasets": datasets, "settings": SART, "name": "Ward 3"})
    assert answer.status_code == 202, answer.text
    batch = answer.json()
    assert answer.headers["location"] == batch["links"]["self"]
    assert [job["dataset"] for job in batch["jobs"]] == datasets
    done = ended(http, batch, until)
    assert (done["state"], done["progress"], done["counts"]) == ("succeeded", 1.0, {"succeeded": 3})
    assert "cancel" not in done["links"]
    for job in done["jobs"]:
        assert http.get(f"/v1/volumes/{job['volume']}").json()["dataset"] == job["dataset"]
    listed = http.get(done["links"]["jobs"]).json()["jobs"]
    assert {job["id"] for job in listed} == {job["id"] for job in batch["jobs"]}
    assert {job["batch"] for job in listed} == {batch["id"]}
    assert [row["id"] for row in http.get("/v1/batches").json()["batches"]] == [batch["id"]]
    # Its deletion takes the results along, not the scans.
    assert http.delete(batch["links"]["self"]).status_code == 204
    assert http.get(batch["links"]["self"]).status_code == 404
    assert http.get("/v1/volumes").json()["volumes"] == http.get("/v1/jobs").json()["jobs"] == []
    assert len(http.get("/v1/datasets").json()["datasets"]) == 3


def test_it_goes_on_after_a_restart(start, scans, work, until):
    http = start(jobs_at_once=1)
    work.hold.clear()
    batch = http.post("/v1/batches", json={"datasets": scans(http), "settings": SART}).json()
    until(http, batch["jobs"][0]["id"], "running")
    assert http.get(batch["links"]["self"]).json()["state"] == "running"
    assert http.delete(batch["links"]["self"]).status_code == 409
    http.__exit__(None, None, None)
    work.hold.set()
    again = start(jobs_at_once=1)
    assert ended(again, batch, until)["state"] == "succeeded"


def test_cancel_ends_the_rest(start, scans, work, until):
    http = start(jobs_at_once=1)
    work.hold.clear()
    batch = http.post("/v1/batches", json={"datasets": scans(http), "settings": SART}).json()
    until(http, batch["jobs"][0]["id"], "running")
    assert http.post(batch["links"]["cancel"]).status_code == 202
    work.hold.set()
    assert ended(http, batch, until)["state"] == "cancelled"
    assert http.post(f"{batch['links']['self']}/cancel").status_code == 409


def test_a_request_that_is_refused_starts_nothing(http, scans):
    (scan,) = scans(http, 1)
    for change, field in (
        ({"datasets": []}, "datasets"),
        ({"datasets": ["ds-0123456789abcdef0123"] * 2}, "datasets"),
        ({"settings": {"nodez": 8}}, "settings.nodez"),
        ({"datasets": ["ds-0123456789abcdef0123"]}, "dataset"),
        ({"name": "x" * 201}, "name"),
        ({"more": 1}, "more"),
    ):
        answer = http.post("/v1/batches", json={"datasets": [scan], **change})
        assert (answer.status_code in (404, 422), answer.json()["field"]) == (True, field)
    assert http.get("/v1/jobs").json()["jobs"] == http.get("/v1/batches").json()["batches"] == []

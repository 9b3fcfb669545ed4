"""DELETE over HTTP: gone at once, and refused while a job needs it."""


def test_a_scan_and_its_result_are_gone(http, uploaded, submitted, until, work):
    dataset = uploaded(http)
    done = until(http, submitted(http, dataset)["id"])
    http.get(done["links"]["data"], params={"format": "npy"})
    assert http.delete(f"/v1/datasets/{dataset}").status_code == 204
    for place in (f"/v1/datasets/{dataset}", done["links"]["self"], done["links"]["volume"]):
        assert http.get(place).status_code == 404
    root = http.app.state.stores.files.root
    assert [path.name for path in root.glob("tenants/**/*") if path.is_file()] == []


def test_while_a_job_needs_it_it_stays(http, uploaded, submitted, until, work):
    dataset = uploaded(http)
    work.hold.clear()
    job = submitted(http, dataset)
    until(http, job["id"], "running")
    answer = http.delete(f"/v1/datasets/{dataset}")
    assert (answer.status_code, answer.json()["type"]) == (409, "/problems/in-use")
    assert job["id"] in answer.json()["found"]
    http.post(f"/v1/jobs/{job['id']}/cancel")
    until(http, job["id"], "cancelled")
    assert http.delete(f"/v1/datasets/{dataset}").status_code == 204

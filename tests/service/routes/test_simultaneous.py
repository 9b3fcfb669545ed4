"""Many requests at once over HTTP: one job, one cancel, no failure."""

from collections import Counter
from concurrent.futures import ThreadPoolExecutor

AT_ONCE = 50


def at_once(ask):
    with ThreadPoolExecutor(AT_ONCE) as pool:
        return list(pool.map(ask, range(AT_ONCE)))


def test_fifty_submits_under_one_key_make_one_job(start, work, uploaded):
    http = start()
    asked = {
        "kind": "reconstruction",
        "dataset": uploaded(http),
        "settings": {"method": "sart", "nodes": 16, "iterations": 1},
    }
    answers = at_once(lambda _: http.post("/v1/jobs", json=asked, headers={"Idempotency-Key": "once"}))
    assert {answer.status_code for answer in answers} == {202}
    assert len({answer.json()["id"] for answer in answers}) == 1
    assert len(http.get("/v1/jobs").json()["jobs"]) == 1


def test_fifty_cancels_end_a_running_job_once(start, work, uploaded, submitted, until):
    http = start()
    work.hold.clear()
    job = submitted(http, uploaded(http))
    until(http, job["id"], "running")
    answers = at_once(lambda _: http.post(job["links"]["cancel"]))
    assert set(Counter(answer.status_code for answer in answers)) <= {202, 409}
    assert any(answer.status_code == 202 for answer in answers)
    assert until(http, job["id"])["state"] == "cancelled"
    told = [line for line in http.get(f"/v1/jobs/{job['id']}/events").text.splitlines() if '"state"' in line]
    assert sum('"cancelling"' in line for line in told) == 1
    assert sum('"cancelled"' in line for line in told) == 1


def test_fifty_cancels_of_a_queued_job(start, work, uploaded, submitted, until):
    http = start(jobs_at_once=1)
    work.hold.clear()
    dataset = uploaded(http)
    first = submitted(http, dataset)
    until(http, first["id"], "running")
    waiting = submitted(http, dataset)
    answers = at_once(lambda _: http.post(waiting["links"]["cancel"]))
    assert Counter(answer.status_code for answer in answers) == {202: 1, 409: AT_ONCE - 1}
    work.hold.set()
    assert until(http, first["id"])["state"] == "succeeded"

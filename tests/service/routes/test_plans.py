"""POST /v1/plans: what a job would be, its time from jobs of the tenant, its place in the queue."""

import numpy as np
import pytest
from sqlalchemy import text

from bentray_service.jobs import kinds

from ..conftest import STREAM, npy, refused, signed

ASKED = {"method": "sart", "nodes": 32, "iterations": 3}


def planned(http, dataset, settings=None, **more):
    body = {"kind": "reconstruction", "dataset": dataset, "settings": settings or ASKED}
    return http.post("/v1/plans", json=body, **more)


def submit(http, dataset, **more):
    body = {"kind": "reconstruction", "dataset": dataset, "settings": ASKED}
    return http.post("/v1/jobs", json=body, **more).json()["id"]


def done_in(http, job, seconds):
    """Let a job have taken this long."""
    with http.app.state.stores.database.write() as connection:
        connection.execute(text(f"UPDATE jobs SET finished = started + {seconds} WHERE id = '{job}'"))


def test_nothing_is_started(http, uploaded, work):
    found = planned(http, uploaded(http))
    assert found.status_code == 200
    record = found.json()
    assert http.get("/v1/jobs").json()["jobs"] == []
    assert work.calls == []
    plan = record["plan"]
    assert (plan["nodes"], plan["methods"], plan["workers"]) == (32, ["bent rays, SART"], 1)
    assert plan["largest_bytes"] == max(plan["call_bytes"].values()) > 0
    assert (record["rough"], record["compared"], record["ahead"]) == (True, 0, 0)
    assert record["minutes"] > 0.0
    candidates = planned(http, http.get("/v1/datasets").json()["datasets"][0]["id"], {"method": "auto"})
    assert len(candidates.json()["plan"]["methods"]) > 2


def test_finished_jobs_of_the_same_method_correct_the_estimate(http, uploaded, work, until):
    dataset = uploaded(http)
    for seconds in (60.0, 60.0, 60.0):
        job = submit(http, dataset)
        until(http, job)
        done_in(http, job, seconds)
    same = planned(http, dataset).json()
    assert (same["minutes"], same["rough"], same["compared"]) == (pytest.approx(1.0), False, 3)
    # In proportion to the work, of which the overhead of any job is a part.
    more = planned(http, dataset, {**ASKED, "iterations": 1000}).json()
    assert more["minutes"] == pytest.approx(more["plan"]["work_s"] / same["plan"]["work_s"], rel=1e-6)
    assert more["minutes"] > 1.2
    other = planned(http, dataset, {**ASKED, "method": "gauss-newton"}).json()
    assert (other["rough"], other["compared"]) == (True, 0)


def test_no_number_without_a_sound_estimate(http, uploaded):
    dataset = uploaded(http)
    found = planned(http, dataset, {**ASKED, "decomposition": "volume"}).json()
    assert (found["minutes"], found["compared"]) == (None, 0)
    assert found["basis"].startswith("No estimate yet")


def test_a_tenant_learns_nothing_of_the_jobs_of_another(http, uploaded, until, work):
    acme, other = signed(http, "acme"), signed(http, "other")
    scans = []
    for headers in (acme, other):
        http.headers.update(headers)
        scans.append(uploaded(http))
    mine, theirs = scans
    before = planned(http, theirs).json()
    http.headers.update(acme)
    for _ in range(3):
        job = submit(http, mine)
        until(http, job, "succeeded")
        done_in(http, job, 3600.0)
    assert planned(http, theirs, headers=other).json() == before
    found = planned(http, mine).json()
    assert (found["minutes"], found["compared"]) == (pytest.approx(60.0), 3)
    refused(planned(http, mine, headers=other), "dataset", status=404)


def test_turntables_take_times_in_proportion_to_their_frames(start, until, monkeypatch):
    monkeypatch.setattr(kinds, "draw_turntable", lambda *args, **control: args[3].write_bytes(b"pictures"))
    http = start()
    content = npy(np.arange(8.0**3).reshape(8, 8, 8))
    volume = http.post("/v1/volumes", content=content, headers=STREAM).json()["id"]

    def body(**settings):
        return {"kind": "refraction", "volume": volume, "settings": settings}

    first = http.post("/v1/plans", json=body(frames=100)).json()
    assert (first["rough"], first["compared"]) == (True, 0)
    assert first["minutes"] == pytest.approx(first["plan"]["work_s"] / 60.0)
    assert (first["plan"]["decomposition"], first["plan"]["workers"]) == ("frames", 1)
    for _ in range(3):
        job = http.post("/v1/jobs", json=body(frames=100)).json()
        assert job["plan"] == first["plan"]
        until(http, job["id"], "succeeded")
        done_in(http, job["id"], 50.0)
    same, more, lit = (
        http.post("/v1/plans", json=body(**one)).json()
        for one in ({"frames": 100}, {"frames": 300}, {"frames": 100, "mode": "shaded"})
    )
    assert (same["minutes"], same["rough"], same["compared"]) == (pytest.approx(50.0 / 60.0), False, 3)
    # The volume is filtered once.
    assert 2.9 * same["minutes"] < more["minutes"] < 3.0 * same["minutes"]
    assert (lit["compared"], lit["rough"]) == (0, True)


def test_the_place_in_the_queue(start, uploaded):
    # Jobs stay where they are: no disk has so much room.
    http = start(min_free_bytes=2**60)
    dataset = uploaded(http)
    for ahead in range(3):
        assert planned(http, dataset).json()["ahead"] == ahead
        job = submit(http, dataset)
        assert http.get(f"/v1/jobs/{job}").json()["ahead"] == ahead


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        ('{"nodes": 1e400}', "settings.nodes"),
        ('{"iterations": 99999999999999999999999999}', "settings.iterations"),
        ('{"method": "sart", "device": "opencl"}', "device"),
        ("[]", "settings"),
    ],
)
def test_what_a_job_is_refused_for_a_plan_is_too(http, uploaded, settings, field):
    body = f'{{"kind": "reconstruction", "dataset": "{uploaded(http)}", "settings": {settings}}}'
    headers = {"Content-Type": "application/json"}
    plan, job = (http.post(f"/v1/{what}", content=body, headers=headers) for what in ("plans", "jobs"))
    refused(plan, field)
    told = [(one.json()["type"], one.json()["found"], one.json()["accepted"]) for one in (plan, job)]
    assert told[0] == told[1]

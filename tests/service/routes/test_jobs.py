"""/v1/jobs and /v1/batches: accepted and rejected requests, search, previews, deletion."""

import base64
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields

import numpy as np
import pytest

from bentray_kernels.acquisition import PICKERS
from bentray_kernels.tomography.reconstruction_graph import ReconstructionCheckpoint
from bentray_kernels.tomography.result import Candidate
from bentray_kernels.tomography.sart import sart_step
from bentray_kernels.tomography.settings import Settings
from bentray_service.files.tenant_files import CHECKPOINTS
from bentray_service.rows.ids import LOCAL, Tenant
from bentray_workers.cluster.checkpoints import Checkpoints
from bentray_workers.reconstruction import reconstruction_run

from ..conftest import HDF5, refused, signed

pytestmark = pytest.mark.usefixtures("work")


@pytest.fixture
def dataset(http, uploaded):
    return uploaded(http)


def ask(http, dataset, settings=None, **more):
    return http.post(
        "/v1/jobs", json={"kind": "reconstruction", "dataset": dataset, "settings": settings or {}, **more}
    )


def test_a_job_is_stored_before_the_answer(http, dataset, work, until):
    work.hold.clear()
    answer = ask(http, dataset, {"nodes": 16})
    body = answer.json()
    assert answer.status_code == 202
    assert answer.headers["location"] == f"/v1/jobs/{body['id']}"
    assert http.app.state.stores.jobs.get(LOCAL, body["id"]).settings == body["settings"]
    assert body["settings"]["nodes"] == 16
    assert body["settings"]["rays"] == "curved"
    assert body["volume"] is None
    work.hold.set()
    until(http, body["id"])


def test_the_runner_gets_the_settings(http, dataset, work, until):
    asked = {"nodes": 20, "rays": "straight", "speed_bounds_mps": [1400, 1600]}
    until(http, ask(http, dataset, asked).json()["id"])
    assert work.calls[0][1] == Settings(nodes=20, rays="straight", speed_bounds_mps=(1400.0, 1600.0))


def test_settings_may_be_left_out(http, dataset, work, until):
    answer = http.post("/v1/jobs", json={"kind": "reconstruction", "dataset": dataset})
    until(http, answer.json()["id"])
    assert work.calls[0][1] == Settings()


def test_plan_is_stored_and_returned(http, dataset):
    job = ask(http, dataset, {"nodes": 16}).json()
    found = http.get(f"/v1/jobs/{job['id']}").json()["plan"]
    assert found == job["plan"]
    assert (found["decomposition"], found["lane"], found["workers"]) == ("emitters", "recon", 1)
    assert found["largest_bytes"] == max(found["call_bytes"].values()) > 0
    assert "1 of 1 workers can run it" in found["why"]


def test_a_task_that_no_worker_can_hold_is_rejected_before_it_is_stored(http, dataset, cluster):
    cluster.memory_bytes = 600 * 2**20
    body = refused(ask(http, dataset, {"nodes": 2048, "method": "gauss-newton"}), "nodes", "at most")
    assert "bytes" in body["found"]
    assert http.get("/v1/jobs").json()["jobs"] == []
    assert ask(http, dataset, {"nodes": 16}).status_code == 202


def test_jobs_are_taken_while_no_worker_is_connected(http, dataset, cluster):
    cluster.workers = 0
    answer = ask(http, dataset, {"nodes": 16})
    assert answer.status_code == 202
    assert "no worker is connected yet" in answer.json()["plan"]["why"]


def test_automatic_choices_are_returned(http, dataset, work, until):
    work.trials = (
        Candidate({"rays": "straight", "method": "sart"}, 2e-8, 1e-8),
        Candidate({"rays": "curved", "method": "sart"}, 3e-8, 1e-8),
    )
    job = ask(http, dataset, {"nodes": 16, "method": "auto"}).json()
    assert (job["advice"], job["title"]) == (None, "Fast: rays and method chosen automatically")
    ended = until(http, job["id"])
    assert ended["title"] == "Fast: bent rays, SART"
    told = ended["advice"]
    assert told.startswith("auto chose straight rays, SART: bent rays do not")


def test_unknown_choices_and_settings_list_the_known_ones(http, dataset):
    for settings, field, found, known in (
        ({"picking": {"picker": "magic"}}, "settings.picking.picker", "'magic'", PICKERS),
        ({"node": 64}, "settings.node", "64", [field.name for field in fields(Settings)]),
    ):
        body = refused(ask(http, dataset, settings), field)
        assert body["found"] == found
        assert all(name in body["accepted"] for name in known)


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        ({"sart": 2}, "settings.sart"),
        ({"speed_bounds_mps": [-1, 1500]}, "settings.speed_bounds_mps"),
        ({"speed_bounds_mps": [0, 1500]}, "settings.speed_bounds_mps"),
        ({"sart": {"relaxation": 0.2}}, "settings.sart"),
        ({"reflection": {"pixel_m": 1e-3}}, "settings.reflection.pixel_m"),
        ({"gauss_newton": {"edge_mps": 7}}, "settings.gauss_newton.edge_mps"),
        ({"reflection": {"gain": "spreading"}}, "settings.reflection.gain"),
        ({"seed": 0}, "settings.seed"),
        ([], "settings"),
        # Devices that no worker offers.
        ({"eikonal": "fim-opencl"}, "eikonal"),
        ({"method": "sart", "device": "opencl"}, "device"),
    ],
)
def test_wrong_settings(http, dataset, settings, field):
    asked = {"kind": "reconstruction", "dataset": dataset, "settings": settings}
    answer = http.post("/v1/jobs", json=asked)
    body = refused(answer, answer.json()["field"])
    assert body["field"].startswith(field)


def test_a_setting_of_the_earlier_flat_record_is_rejected_with_what_to_use_instead(http, dataset):
    for name, value, accepted in (
        ("sweeps", 3, "iterations, which replaces it"),
        ("relaxation", 0.1, "no such setting: updates of SART are relaxed by 0.1"),
        ("attenuation", False, "attenuation.enabled, which replaces it"),
        ("picker", "aic", "picking.picker, which replaces it"),
        ("coarser_grids", 1, "no such setting: it is decided automatically"),
        ("bands", 1, "no such setting: it is decided automatically, from minutes"),
        ("speed_update", "fixed", "no such setting: the wave front"),
        ("numerics", {}, "a known setting: "),
    ):
        body = refused(ask(http, dataset, {name: value}), f"settings.{name}")
        assert body["accepted"].startswith(accepted)


def test_every_wrong_value_is_listed(http, dataset):
    body = ask(http, dataset, {"nodes": "many", "rays": "wavy"}, colour="red").json()
    assert {"settings.nodes", "settings.rays", "colour"} <= {one["field"] for one in body["errors"]}


def test_bodies_that_are_no_request(http, dataset):
    for content, kind, status, accepted in (
        (b"{", "application/json", 422, "a JSON object"),
        (b"a=b", "text/plain", 415, "application/json"),
    ):
        answer = http.post("/v1/jobs", content=content, headers={"Content-Type": kind})
        assert (answer.status_code, answer.json()["accepted"]) == (status, accepted)
    answer = ask(http, dataset, {"method": "x" * 1_000_000})
    assert refused(answer, "body", status=413)["type"] == "/problems/too-large"


def test_cancel_an_ended_job(http, dataset, until):
    job = until(http, ask(http, dataset, {"nodes": 16}).json()["id"])
    answer = http.post(f"/v1/jobs/{job['id']}/cancel")
    assert (answer.status_code, answer.json()["found"]) == (409, "succeeded")


def test_the_same_request_twice_makes_one_job(http, dataset, work):
    work.hold.clear()
    key = {"Idempotency-Key": "scan 7, first try"}
    asked = {"kind": "reconstruction", "dataset": dataset, "settings": {"method": "sart", "nodes": 16}}
    first, again = (http.post("/v1/jobs", json=asked, headers=key) for _ in range(2))
    assert (first.status_code, again.status_code) == (202, 202)
    assert first.json()["id"] == again.json()["id"]
    assert [one.headers.get("idempotency-replayed") for one in (first, again)] == [None, "true"]
    other = http.post("/v1/jobs", json={**asked, "settings": {"method": "sart", "nodes": 17}}, headers=key)
    refused(other, "Idempotency-Key", status=409)
    assert http.post("/v1/jobs", json=asked).json()["id"] != first.json()["id"]
    assert http.post("/v1/jobs", json=asked, headers={"Idempotency-Key": 201 * "x"}).status_code == 422
    with ThreadPoolExecutor(16) as pool:
        send = lambda _: http.post("/v1/jobs", json=asked, headers={"Idempotency-Key": "k"}).json()["id"]  # noqa: E731
        assert len(set(pool.map(send, range(50)))) == 1
    assert len(http.get("/v1/jobs").json()["jobs"]) == 3
    work.hold.set()


def test_pages_lead_to_every_job_once(http, dataset, until):
    made = [ask(http, dataset, {"nodes": 16}).json()["id"] for _ in range(7)]
    for job in made:
        until(http, job)
    cancelled = http.get("/v1/jobs?state=cancelled").json()
    assert cancelled == {"jobs": [], "next": None}
    seen, address = [], "/v1/jobs?limit=3&state=succeeded&kind=reconstruction"
    while address is not None:
        page = http.get(address).json()
        assert len(page["jobs"]) <= 3
        seen += [job["id"] for job in page["jobs"]]
        address = page["next"]
    assert seen == made[::-1]
    assert http.get("/v1/jobs?kind=refraction").json()["jobs"] == []
    assert http.get(f"/v1/jobs?before=job-{20 * '0'}").status_code == 404
    for wrong in ("state=lost", "kind=cake", "limit=0", "before=../x"):
        assert http.get(f"/v1/jobs?{wrong}").status_code in (404, 422)


def found(http, **query):
    return [job["id"] for job in http.get("/v1/jobs", params=query).json()["jobs"]]


def test_text_filters_by_name_scan_and_owner(http, dataset):
    plain, named, noted = (ask(http, dataset, {"nodes": 16}).json()["id"] for _ in range(3))
    http.patch(f"/v1/jobs/{named}", json={"name": "Left 100 %_ Übung\\"})
    http.patch(f"/v1/jobs/{noted}", json={"notes": "water at 31 °C"})
    assert found(http, text="left") == found(http, text="LEFT 100") == [named]
    assert found(http, text="31 °") == [noted]
    assert found(http, text=plain) == [plain]
    assert found(http, text=dataset, kind="reconstruction") == [noted, named, plain]
    # No character is a pattern, and what is found is what was written, also beyond ASCII.
    for words, expected in (("%", [named]), ("_", [named]), ("\\", [named]), ("Übung", [named]), ("%%", [])):
        assert found(http, text=words) == expected, words
    for text in ("' OR 1=1 --", "\\\\'", "%' ESCAPE '", "\N{PILE OF POO}", "a\nb"):
        answer = http.get("/v1/jobs", params={"text": text})
        assert (answer.status_code, answer.json()) == (200, {"jobs": [], "next": None}), text
    assert found(http, text="") == [noted, named, plain]
    assert found(http, text="sixteen ELEMENTS") == [noted, named, plain]
    http.patch(f"/v1/datasets/{dataset}", json={"title": "Right breast"})
    assert found(http, text="right breast", kind="reconstruction") == [noted, named, plain]
    assert found(http, text="right breast", kind="simulation") == []
    page = http.get("/v1/jobs", params={"text": "right", "limit": 2}).json()
    assert [job["id"] for job in page["jobs"]] == [noted, named]
    assert [job["id"] for job in http.get(page["next"]).json()["jobs"]] == [plain]


def test_a_deleted_job_is_gone_with_its_volume(http, dataset, work, until):
    done = until(http, ask(http, dataset, {"nodes": 16}).json()["id"])
    other = until(http, ask(http, dataset, {"nodes": 16}).json()["id"])
    assert http.delete(done["links"]["self"]).status_code == 204
    for gone in (done["links"]["self"], done["links"]["volume"]):
        assert http.get(gone).status_code == 404
    assert http.delete(done["links"]["self"]).status_code == 404
    assert [found(http), http.get(other["links"]["volume"]).status_code] == [[other["id"]], 200]
    assert http.get(f"/v1/datasets/{dataset}").status_code == 200


def test_a_running_job_is_not_deleted(http, running, work, until):
    job = running(http)
    answer = http.delete(job["links"]["self"])
    assert (answer.status_code, answer.json()["type"]) == (409, "/problems/in-use")
    work.hold.set()
    until(http, job["id"], "succeeded")


def test_values_of_the_checkpoint_for_its_owner_alone(http, running, until, work):
    state, other = http.app.state, signed(http, "other")
    http.headers.update(signed(http, "acme"))
    job = running(http)
    here = f"/v1/jobs/{job['id']}/preview"
    assert job["links"]["preview"] == here
    none_yet = http.get(here)
    assert (none_yet.status_code, none_yet.json()["type"]) == (409, "/problems/no-preview")
    assert "before its first image" in none_yet.json()["found"]
    speed = 1500.0 + np.arange(20.0).reshape(5, 4)
    checkpoint = ReconstructionCheckpoint(0, 0, (), sart_step.begin(1.0 / speed), (), 2e-3, (-0.01, 0.0))
    Checkpoints(state.stores.files.of(Tenant("acme")).checkpoints(job["id"])).save("0-00000", checkpoint)
    answer = http.get(here)
    assert (answer.status_code, answer.headers["cache-control"]) == (200, "no-store")
    body = answer.json()
    values = np.frombuffer(base64.b64decode(body["speed"]), dtype="<f4").reshape(body["shape"])
    np.testing.assert_array_equal(values, speed.astype(np.float32))
    assert body["range_mps"] == [1500.0, 1519.0]
    assert (body["spacing_m"], body["origin_m"]) == ([2e-3, 2e-3], [-0.01, 0.0])
    stranger = http.get(here, headers=other)
    assert (stranger.status_code, stranger.json()["type"]) == (404, "/problems/unknown-id")
    work.hold.set()
    assert "preview" not in until(http, job["id"])["links"]
    over = http.get(here)
    assert over.status_code == 409
    assert "succeeded" in over.json()["found"]


def test_a_queued_job_and_another_kind_have_none(start, uploaded, submitted):
    # Jobs stay where they are: no disk has so much room.
    http = start("full", min_free_bytes=2**60)
    simulation = http.post("/v1/jobs", json={"kind": "simulation", "settings": {"nodes": 16}}).json()
    for job in (submitted(http, uploaded(http)), simulation):
        answer = http.get(f"/v1/jobs/{job['id']}/preview")
        assert (answer.status_code, answer.json()["type"]) == (409, "/problems/no-preview")
        assert f"{job['kind']}, queued" in answer.json()["found"]
        assert "after its first iteration" in answer.json()["accepted"]
        assert "preview" not in job["links"]


def test_the_folder_is_that_of_the_worker():
    assert CHECKPOINTS == reconstruction_run.CHECKPOINTS


SART = {"method": "sart", "nodes": 16, "iterations": 2}


@pytest.fixture
def scans(scan):
    """Upload different scans; returns their ids."""

    def send(http, number=3):
        paths = [
            scan(lambda file, k=k: file.attrs.update(title=f"Scan {k}"), f"{k}.h5") for k in range(number)
        ]
        sent = [http.post("/v1/datasets", content=path.read_bytes(), headers=HDF5) for path in paths]
        return [answer.json()["id"] for answer in sent]

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

"""Jobs of kind simulation: from settings to an image, to the bits of the command line; ended and refused."""

import hashlib
import threading

import pytest
from typer.testing import CliRunner

from bentray_service.cli import app as command_line
from bentray_service.rows.ids import LOCAL
from bentray_workers.simulation import parts

from ...waiting import wait_until
from ..conftest import refused

SMALL = {"nodes": 16, "elements": 16, "noise_s": 2e-8, "seed": 7}
WAVES = {"waveform": True, "nodes": 32, "elements": 16, "frequency_hz": 2e5, "side_m": 0.03, "emissions": 4}


def ask(http, **settings):
    return http.post("/v1/jobs", json={"kind": "simulation", "settings": settings})


@pytest.fixture
def held(monkeypatch):
    """Emissions after the first wait until this event is set."""
    go_on, begun = threading.Event(), []
    real = parts.simulate_emission

    def slow(settings, emission, poll):
        begun.append(emission)
        if len(begun) > 1:
            go_on.wait()
        return real(settings, emission, poll)

    monkeypatch.setattr(parts, "simulate_emission", slow)
    go_on.begun = begun
    yield go_on
    go_on.set()


def test_from_settings_to_an_image(on_workers, until, tmp_path):
    with on_workers() as http:
        answer = ask(http, **SMALL)
        job = answer.json()
        assert answer.status_code == 202, job
        assert (job["kind"], job["dataset"], job["volume"]) == ("simulation", None, None)
        assert job["settings"] == {
            "phantom": "table6",
            "waveform": False,
            "refinement": 4,
            "coupling_mps": 1500.0,
            "attenuation": False,
            **SMALL,
        }
        plan = job["plan"]
        assert (plan["tasks"], plan["workers"], plan["lane"]) == (2, 1, "recon")
        assert set(plan["call_bytes"]) == {"make_part", "write_scan"}
        assert plan["minutes"] > 0.0
        assert plan["field_bytes"] is None
        done = until(http, job["id"])
        assert done["state"] == "succeeded", done["error"]
        assert done["progress"] == {"done": 2, "total": 2, "phase": ""}
        assert "volume" not in done["links"]
        made = http.get(done["links"]["dataset"]).json()
        assert (made["id"], made["job"], made["elements"]) == (done["dataset"], job["id"], 16)
        assert (made["has_truth"], made["has_travel_times"], made["has_traces"]) == (True, True, False)
        assert http.get("/v1/datasets").json() == {"datasets": [made], "next": None}
        assert [one["id"] for one in http.get("/v1/jobs?kind=simulation").json()["jobs"]] == [job["id"]]
        # The command line makes the same file, and an upload of it is kept as the same file.
        path = tmp_path / "scan.h5"
        words = ["--nodes", "16", "--elements", "16", "--noise-ns", "20", "--seed", "7", "-o", str(path)]
        assert CliRunner().invoke(command_line, ["simulate", *words]).exit_code == 0
        files = http.app.state.stores.files.of(LOCAL)
        assert http.get(made["links"]["file"]).content == path.read_bytes()
        assert hashlib.sha256(path.read_bytes()).hexdigest() == made["sha256"]
        sent = {"content": path.read_bytes(), "headers": {"Content-Type": "application/x-hdf5"}}
        again = http.post("/v1/datasets", **sent).json()
        assert {**again, "id": made["id"], "job": job["id"]} == {
            **made,
            "created": again["created"],
            "links": again["links"],
        }
        # And it is reconstructed as any scan.
        settings = {"nodes": 16, "iterations": 1, "attenuation": {"enabled": False}}
        asked = {"kind": "reconstruction", "dataset": made["id"], "settings": settings}
        image = until(http, http.post("/v1/jobs", json=asked).json()["id"])
        assert (image["state"], image["dataset"]) == ("succeeded", made["id"]), image["error"]
        assert http.get(image["links"]["image"]).status_code == 200
        assert not list((files.root / "work").iterdir())


def test_wave_simulation_and_deletion_of_its_job(on_workers, until):
    with on_workers() as http:
        done = until(http, ask(http, **WAVES).json()["id"])
        assert (done["state"], done["progress"]["total"]) == ("succeeded", 5), done["error"]
        made = http.get(done["links"]["dataset"]).json()
        assert (made["has_traces"], made["has_travel_times"], made["ntx"]) == (True, False, 4)
        assert http.delete(done["links"]["dataset"]).status_code == 204
        assert http.get(done["links"]["self"]).status_code == 404
        assert http.get("/v1/datasets").json() == {"datasets": [], "next": None}
        assert not list((http.app.state.stores.files.of(LOCAL).root / "datasets").iterdir())


def test_cancel_while_a_task_is_at_work(on_workers, until, held):
    with on_workers() as http:
        job = ask(http, **WAVES).json()
        until(http, job["id"], "running")
        wait_until(lambda: len(held.begun) == 2)
        assert http.post(job["links"]["cancel"]).status_code == 202
        done = until(http, job["id"])
        assert (done["state"], done["dataset"], done["progress"]["total"]) == ("cancelled", None, 5)
        assert done["progress"]["done"] <= 1
        held.set()
        files = http.app.state.stores.files.of(LOCAL)
        assert not list((files.root / "datasets").iterdir())
    # What was still at work has found no folder to leave anything in.
    with on_workers() as http:
        assert not list((files.root / "work").iterdir())


def test_stopped_service_resumes(on_workers, until, held):
    with on_workers() as http:
        job = ask(http, **WAVES).json()["id"]
        until(http, job, "running")
        work = http.app.state.stores.files.of(LOCAL).work(job)
        wait_until(lambda: list(work.rglob("*.npz")))
    held.set()
    with on_workers() as http:
        done = until(http, job)
        assert done["state"] == "succeeded", done["error"]
        assert done["progress"] == {"done": 5, "total": 5, "phase": ""}
        events = [event.state for event in http.app.state.stores.jobs.updates({job: 0})[1][job]]
        assert events == ["queued", "running", "queued", "running", "succeeded"]
        fresh = until(http, ask(http, **WAVES).json()["id"])
        both = [http.get(one["links"]["dataset"]).json()["sha256"] for one in (done, fresh)]
        assert both[0] == both[1]
    assert held.begun.count(0) == 2, "the first emission of either job is made once"


@pytest.mark.parametrize(
    ("settings", "field"),
    [({"refinement": 64}, "nodes"), ({"elements": 4096, "attenuation": True}, "elements")],
)
def test_rejects_invalid_input(http, cluster, settings, field):
    cluster.memory_bytes = 2**30
    refused(ask(http, **settings), field)
    assert http.get("/v1/jobs").json()["jobs"] == []
    more = {"kind": "simulation", "dataset": "ds-1", "settings": {}}
    refused(http.post("/v1/jobs", json=more), "dataset")


def test_a_file_that_the_tenant_has_no_room_for_is_not_begun(start):
    http = start(max_tenant_bytes=100_000)
    refused(ask(http, nodes=16, elements=200), "storage", status=507)
    assert ask(http, **SMALL).status_code == 202

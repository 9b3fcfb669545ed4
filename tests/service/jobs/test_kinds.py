"""Jobs of kind refraction: three pictures of a ball, cancelled, refused, and taken up again after a death."""

import io
import zipfile
from contextlib import contextmanager

import pytest
from fastapi.testclient import TestClient
from PIL import Image

from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import TWO_HOLES, sampled
from bentray_kernels.tomography import Progress
from bentray_service.app import create_app
from bentray_service.jobs import kinds
from bentray_service.settings import ServiceSettings
from bentray_service.storage.ids import new_id
from bentray_workers.cluster import open_cluster
from bentray_workers.slices import Cancelled
from bentray_workers.volume_file import Volume, write_volume

SMALL = {"width": 24, "height": 16, "iso": [0.5], "frames": 3}


@pytest.fixture(scope="module")
def workers():
    with open_cluster(workers=1, processes=False) as cluster:
        yield cluster


@pytest.fixture
def serving(tmp_path, workers):
    """Start the service on the real cluster; again on the same folder when it is called again."""

    @contextmanager
    def go():
        app = create_app(ServiceSettings(data_dir=tmp_path / "data"), workers)
        with TestClient(app, raise_server_exceptions=False) as http:
            yield http

    return go


def put(http, spacing=(1e-3,) * 3):
    """A volume as an upload leaves it; its id."""
    parts = http.app.state.parts
    volume, volume_id = Volume.of(sampled(TWO_HOLES, 12), spacing), new_id("volume")
    write_volume(parts.files.volume(volume_id), volume)
    summary = {
        "title": "a ball",
        "shape": list(volume.values.shape),
        "spacing_m": list(spacing),
        "origin_m": [0.0] * 3,
        "value_range": list(volume.range()),
    }
    parts.volumes.add(volume_id, size=1, sha256="0" * 64, summary=summary)
    return volume_id


def ask(http, volume, **settings):
    asked = {"kind": "refraction", "volume": volume, "settings": {**SMALL, **settings}}
    return http.post("/v1/jobs", json=asked)


@pytest.mark.parametrize(("form", "media"), [("zip", "application/zip"), ("apng", "image/apng")])
def test_three_pictures(serving, until, form, media):
    with serving() as http:
        volume = put(http)
        answer = ask(http, volume, format=form, turn_deg=90)
        job = answer.json()
        assert answer.status_code == 202, job
        assert (job["kind"], job["dataset"], job["volume"]) == ("refraction", None, volume)
        assert job["settings"]["turn_deg"] == 90
        assert "animation" not in job["links"]
        done = until(http, job["id"])
        assert (done["state"], done["progress"]) == ("succeeded", {"done": 3, "total": 3}), done["error"]
        assert http.get(done["links"]["volume"]).json()["id"] == volume
        found = http.get(done["links"]["animation"])
        assert found.headers["content-type"] == media
        assert found.headers["content-disposition"] == f'attachment; filename="{job["id"]}.{form}"'
        if form == "zip":
            with zipfile.ZipFile(io.BytesIO(found.content)) as archive:
                assert len(archive.namelist()) == 3
                view = {"width": 24, "height": 16, "iso": 0.5}
                same = http.get(f"{done['links']['volume']}/refraction.png", params=view)
                assert archive.read("0000.png") == same.content
        else:
            assert Image.open(io.BytesIO(found.content)).n_frames == 3
        assert [one["id"] for one in http.get("/v1/volumes").json()["volumes"]] == [volume]
        assert not list(http.app.state.parts.files.scratch.iterdir())


def test_without_settings_the_middle_of_the_range(serving, until, monkeypatch):
    asked = []
    monkeypatch.setattr(kinds, "turn", lambda *given: asked.append(given) or given[3].write_bytes(b""))
    with serving() as http:
        volume = put(http)
        job = http.post("/v1/jobs", json={"kind": "refraction", "volume": volume}).json()
        assert until(http, job["id"])["state"] == "succeeded"
        low, high = http.get(f"/v1/volumes/{volume}").json()["value_range"]
    assert asked[0][2].iso == (0.5 * (low + high),)
    assert asked[0][2].frames == 36


def test_cancel_between_pictures(serving, until):
    with serving() as http:
        job = ask(http, put(http), frames=720, width=256, height=256).json()
        until(http, job["id"], "running")
        assert http.post(job["links"]["cancel"]).status_code == 202
        done = until(http, job["id"])
        assert (done["state"], done["progress"]["total"]) == ("cancelled", 720)
        assert done["progress"]["done"] < 720
        assert not list((http.app.state.parts.files.root / "animations").iterdir())
        answer = http.get(f"/v1/jobs/{job['id']}/animation")
        assert (answer.status_code, answer.json()["type"]) == (404, "/problems/no-animation")


def test_a_stopped_job_runs_again_at_the_next_start(serving, until, monkeypatch):
    def hold(client, path, turntable, target, work_dir, on_progress, stop):
        on_progress(Progress(1, 3))
        while not stop():
            pass
        raise Cancelled

    monkeypatch.setattr(kinds, "turn", hold)
    with serving() as http:
        job = ask(http, put(http)).json()
        until(http, job["id"], "running")
    monkeypatch.undo()
    with serving() as http:
        assert until(http, job["id"])["state"] == "succeeded"
        states = [event["state"] for event in http.app.state.parts.jobs.events(job["id"])]
    assert states == ["queued", "running", "queued", "running", "succeeded"]


def test_what_the_worker_refuses_fails_in_words(serving, until, monkeypatch):
    def refuse(*given):
        raise InvalidInput("iso", "0.5", "what the filter leaves")

    monkeypatch.setattr(kinds, "turn", refuse)
    with serving() as http:
        done = until(http, ask(http, put(http)).json()["id"])
    assert (done["state"], done["error"]["field"]) == ("failed", "iso")


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        ({"iso": [7.0]}, "iso"),
        ({"iso": 0.5}, "settings.iso"),
        ({"index": [-1.0]}, "settings.index"),
        ({"frames": 0}, "settings.frames"),
        ({"frames": 720, "width": 2048, "height": 2048}, "settings.frames"),
        ({"format": "gif"}, "settings.format"),
        ({"speed": 3}, "settings.speed"),
        ({"width": "wide"}, "settings.width"),
    ],
)
def test_wrong_settings(start, settings, field):
    http = start()
    answer = ask(http, put(http), **settings)
    body = answer.json()
    assert (answer.status_code, body["field"].removesuffix(".0")) == (422, field), body
    assert body["accepted"]
    assert http.get("/v1/jobs").json() == {"jobs": []}


def test_other_refusals(start):
    http = start()
    volume = put(http)
    for asked, field in (
        ({"kind": "refraction"}, "volume"),
        ({"kind": "refraction", "volume": volume, "dataset": "ds-1"}, "dataset"),
        ({"kind": "miracle"}, "kind"),
        ({}, "kind"),
    ):
        body = http.post("/v1/jobs", json=asked).json()
        assert (body["status"], body["field"]) == (422, field), body
    assert ask(http, "vol-" + "0" * 20).status_code == 404


def test_a_reconstruction_has_no_animation(start, work, uploaded, submitted, until):
    http = start()
    job = until(http, submitted(http, uploaded(http))["id"])
    assert http.get(f"/v1/jobs/{job['id']}/animation").json()["type"] == "/problems/no-animation"

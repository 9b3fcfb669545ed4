"""Kinds of jobs: turntables and geometry fields; cancelled, refused, and taken up again after a death."""

import io
import zipfile

import pytest
from PIL import Image

from bentray_kernels.meshes.defects import sound
from bentray_kernels.meshes.example_surfaces import torus
from bentray_kernels.phantoms import TWO_HOLES, sampled
from bentray_kernels.task_graph import Cancelled
from bentray_kernels.tomography import Progress
from bentray_service.jobs import kinds
from bentray_service.rows.checksums import Checksums
from bentray_service.rows.ids import LOCAL, new_id
from bentray_service.rows.tables import JobRow
from bentray_workers.files.mesh import StoredMesh, summary_of, write_mesh
from bentray_workers.rendering import field_settings, geometry_field

from ...waiting import wait_until
from ..conftest import refused
from ..stored_volumes import store_volume

SMALL = {"width": 24, "height": 16, "iso": [0.5], "frames": 3}


def put(http, spacing=(1e-3,) * 3):
    return store_volume(http, sampled(TWO_HOLES, 12), spacing)


def ask(http, volume, **settings):
    asked = {"kind": "refraction", "volume": volume, "settings": {**SMALL, **settings}}
    return http.post("/v1/jobs", json=asked)


@pytest.mark.parametrize(("form", "media"), [("zip", "application/zip"), ("apng", "image/apng")])
def test_three_pictures(on_workers, until, form, media):
    with on_workers() as http:
        volume = put(http)
        answer = ask(http, volume, format=form, turn_deg=90)
        job = answer.json()
        assert answer.status_code == 202, job
        assert (job["kind"], job["dataset"], job["volume"]) == ("refraction", None, volume)
        assert job["settings"]["turn_deg"] == 90
        assert "animation" not in job["links"]
        done = until(http, job["id"])
        assert done["state"] == "succeeded", done["error"]
        assert done["progress"] == {"done": 3, "total": 3, "phase": ""}
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
        assert not list(http.app.state.stores.files.scratch.iterdir())


def test_without_an_iso_value_the_middle_of_the_range_once_the_smoothing_is_known(
    on_workers, until, monkeypatch
):
    """Smoothing changes the range; the worker, which knows the type of the values, decides on it."""
    asked = []
    draw = lambda *given, **control: asked.append(given) or given[3].write_bytes(b"")  # noqa: E731
    monkeypatch.setattr(kinds, "draw_turntable", draw)
    with on_workers() as http:
        volume = put(http)
        for settings in ({"smoothing": 0.0}, {}):
            started = {"kind": "refraction", "volume": volume, "settings": settings}
            assert until(http, http.post("/v1/jobs", json=started).json()["id"])["state"] == "succeeded"
        low, high = http.get(f"/v1/volumes/{volume}").json()["value_range"]
    assert [one[2].iso for one in asked] == [(0.5 * (low + high),), ()]
    assert [one[2].frames for one in asked] == [36, 36]


def test_cancel_between_pictures(on_workers, until):
    with on_workers() as http:
        job = ask(http, put(http), frames=720, width=256, height=256).json()
        until(http, job["id"], "running")
        assert http.post(job["links"]["cancel"]).status_code == 202
        done = until(http, job["id"])
        assert (done["state"], done["progress"]["total"]) == ("cancelled", 720)
        assert done["progress"]["done"] < 720
        assert not list((http.app.state.stores.files.of(LOCAL).root / "animations").iterdir())
        answer = http.get(f"/v1/jobs/{job['id']}/animation")
        assert (answer.status_code, answer.json()["type"]) == (409, "/problems/no-animation")


def test_a_stopped_job_runs_again_at_the_next_start(on_workers, until, monkeypatch):
    def hold(client, path, turntable, target, work_dir, on_progress, on_saved, stop, share):
        on_progress(Progress(1, 3))
        while not stop():
            pass
        raise Cancelled

    monkeypatch.setattr(kinds, "draw_turntable", hold)
    with on_workers() as http:
        job = ask(http, put(http)).json()
        until(http, job["id"], "running")
    monkeypatch.undo()
    with on_workers() as http:
        assert until(http, job["id"])["state"] == "succeeded"
        states = [event.state for event in http.app.state.stores.jobs.updates({job["id"]: 0})[1][job["id"]]]
    # On a loaded machine the workers of the second service may connect late; the job then waits again.
    assert states[:4] == ["queued", "running", "queued", "running"]
    assert states[-1] == "succeeded"


def test_other_refusals(http):
    volume = put(http)
    for settings, field in (
        ({"iso": [7.0]}, "iso"),
        ({"iso": 0.5}, "settings.iso"),
        ({"frames": 720, "width": 2048, "height": 2048}, "settings.frames"),
    ):
        answer = ask(http, volume, **settings)
        assert refused(answer, answer.json()["field"])["field"].removesuffix(".0") == field
    for asked, field in (
        ({"kind": "refraction"}, "volume"),
        ({"kind": "refraction", "volume": volume, "dataset": "ds-1"}, "dataset"),
        ({"kind": "miracle"}, "kind"),
        ({}, "kind"),
    ):
        refused(http.post("/v1/jobs", json=asked), field)
    assert http.get("/v1/jobs").json()["jobs"] == []
    assert ask(http, "vol-" + "0" * 20).status_code == 404


def test_a_reconstruction_has_no_animation(http, work, uploaded, submitted, until):
    job = until(http, submitted(http, uploaded(http))["id"])
    assert http.get(f"/v1/jobs/{job['id']}/animation").json()["type"] == "/problems/no-animation"


COARSE = {"samples": 6, "inner_samples": 4, "divisions": 4, "image_size": 33}


def put_mesh(http, mesh=None):
    """A mesh as an upload leaves it; its id."""
    state, mesh_id = http.app.state, new_id("mesh")
    stored = StoredMesh(torus(16, 10) if mesh is None else mesh)
    write_mesh(state.stores.files.of(LOCAL).mesh(mesh_id), stored)
    summary = summary_of(stored, sound(stored.mesh.vertices, stored.mesh.faces), "ply")
    state.stores.meshes.add(LOCAL, mesh_id, size=1, sha256="0" * 64, summary={**summary, "title": "a ring"})
    return mesh_id


def ask_field(http, mesh, **settings):
    asked = {"kind": "geometry-field", "mesh": mesh, "settings": {**COARSE, **settings}}
    return http.post("/v1/jobs", json=asked)


def wait_until_empty(folder):
    """What a job made on its way goes right after its end is stored."""
    wait_until(lambda: not list(folder.iterdir()))


def test_a_cancelled_field_leaves_nothing(on_workers, until, monkeypatch):
    def hold(*given, stop, **control):
        while not stop():
            pass
        raise Cancelled

    monkeypatch.setattr(geometry_field, "build_field", hold)
    with on_workers() as http:
        job = ask_field(http, put_mesh(http)).json()
        until(http, job["id"], "running")
        assert http.post(job["links"]["cancel"]).status_code == 202
        done = until(http, job["id"])
        assert (done["state"], done["field"]) == ("cancelled", None)
        assert "field" not in done["links"]
        assert http.get("/v1/geometry-fields").json() == {"geometry_fields": []}
        wait_until_empty(http.app.state.stores.files.of(LOCAL).root / "work")


def test_a_field_that_is_cancelled_at_its_end_stays_for_others(start):
    state = start().app.state
    files = state.stores.files.of(LOCAL)
    kept = files.field(new_id("field"))
    kept.mkdir()
    kinds.KINDS["geometry-field"].discard(files, kept)
    assert kept.exists()


@pytest.mark.parametrize("kind", ["reconstruction", "simulation"])
def test_cancelled_fields_leave_no_files(start, kind):
    state = start().app.state
    files = state.stores.files.of(LOCAL)
    written = kinds.KINDS[kind].target(files, JobRow(id=new_id("job")))
    written.write_bytes(b"x")
    state.stores.files.store.publish(written)
    kinds.KINDS[kind].discard(files, written)
    assert not written.exists()
    assert Checksums(state.stores.database).all() == []


def test_other_refusals_of_a_field(http, monkeypatch):
    assert ask_field(http, "mesh-" + "0" * 20).status_code == 404
    mesh = put_mesh(http)
    both = {"kind": "geometry-field", "mesh": mesh, "volume": "vol-1"}
    refused(http.post("/v1/jobs", json=both), "volume")
    monkeypatch.setattr(field_settings, "MAX_FACES", 100)
    refused(ask_field(http, mesh), "mesh")


@pytest.mark.parametrize(
    ("settings", "made_by", "title"),
    [
        ({"method": "auto", "minutes": 30}, "full waveform to 450 kHz", "Best: full waveform to 450 kHz"),
        ({"method": "auto"}, "bent rays, Gauss-Newton", "Fast: bent rays, Gauss\N{EN DASH}Newton"),
        ({"method": "waveform"}, None, "Best: full waveform"),
        ({"method": "sart", "rays": "straight"}, None, "Straight rays, SART"),
    ],
)
def test_a_title_says_what_made_the_image(settings, made_by, title):
    row = JobRow(settings=settings, plan={"made_by": made_by} if made_by else None)
    assert kinds.KINDS["reconstruction"].title(row) == title


def test_task_rejection_fails_the_job_with_a_message(on_workers, until):
    with on_workers() as http:
        done = until(http, ask_field(http, put_mesh(http), image_threshold=1e-12).json()["id"])
    assert (done["state"], done["error"]["field"]) == ("failed", "threshold")

"""/v1/jobs/{id}/preview: the image of a running reconstruction for its owner, else a reason."""

import base64

import numpy as np

from bentray_kernels.tomography.reconstruction_graph import ReconstructionCheckpoint
from bentray_kernels.tomography.sart import sart_step
from bentray_service.files.tenant_files import CHECKPOINTS
from bentray_service.rows.ids import Tenant
from bentray_service.rows.keys import ApiKey, Keys
from bentray_workers.cluster.checkpoints import Checkpoints
from bentray_workers.reconstruction import reconstruction_run


def test_values_of_the_checkpoint_for_its_owner_alone(http, uploaded, submitted, until, work):
    state, auth = http.app.state, {}
    for tenant in ("acme", "other"):
        token = ApiKey.new()
        Keys(state.stores.database).add(token, Tenant(tenant), tenant, ("read", "write"))
        auth[tenant] = {"Authorization": f"Bearer {token.shown()}"}
    http.headers.update(auth["acme"])
    work.hold.clear()
    job = submitted(http, uploaded(http))["id"]
    here = f"/v1/jobs/{job}/preview"
    assert until(http, job, "running")["links"]["preview"] == here
    none_yet = http.get(here)
    assert (none_yet.status_code, none_yet.json()["type"]) == (409, "/problems/no-preview")
    assert "before its first image" in none_yet.json()["found"]
    speed = 1500.0 + np.arange(20.0).reshape(5, 4)
    checkpoint = ReconstructionCheckpoint(0, 0, (), sart_step.begin(1.0 / speed), (), 2e-3, (-0.01, 0.0))
    Checkpoints(state.stores.files.of(Tenant("acme")).checkpoints(job)).save("0-00000", checkpoint)
    answer = http.get(here)
    assert (answer.status_code, answer.headers["cache-control"]) == (200, "no-store")
    body = answer.json()
    values = np.frombuffer(base64.b64decode(body["speed"]), dtype="<f4").reshape(body["shape"])
    np.testing.assert_array_equal(values, speed.astype(np.float32))
    assert body["range_mps"] == [1500.0, 1519.0]
    assert (body["spacing_m"], body["origin_m"]) == ([2e-3, 2e-3], [-0.01, 0.0])
    stranger = http.get(here, headers=auth["other"])
    assert (stranger.status_code, stranger.json()["type"]) == (404, "/problems/unknown-id")
    work.hold.set()
    assert "preview" not in until(http, job)["links"]
    over = http.get(here)
    assert over.status_code == 409
    assert "succeeded" in over.json()["found"]


def test_a_queued_job_and_another_kind_have_none(start, uploaded, submitted):
    # Jobs stay where they are: no disk has so much room.
    http = start(min_free_bytes=2**60)
    simulation = http.post("/v1/jobs", json={"kind": "simulation", "settings": {"nodes": 16}}).json()
    for job in (submitted(http, uploaded(http)), simulation):
        answer = http.get(f"/v1/jobs/{job['id']}/preview")
        problem = answer.json()
        assert (answer.status_code, problem["type"]) == (409, "/problems/no-preview")
        assert f"{job['kind']}, queued" in problem["found"]
        assert "after its first iteration" in problem["accepted"]
        assert "preview" not in job["links"]


def test_the_folder_is_that_of_the_worker():
    assert CHECKPOINTS == reconstruction_run.CHECKPOINTS

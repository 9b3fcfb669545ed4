"""A job with ``method`` waveform over HTTP: the bits of one process, also after interruptions."""

from __future__ import annotations

import io
import time
from dataclasses import replace

import numpy as np
import pytest
from distributed.comm import CommClosedError
from fastapi.testclient import TestClient

from bentray_kernels.acquisition import pick
from bentray_kernels.tomography import Settings, reconstruct
from bentray_service.app import create_app
from bentray_service.rows.tenants import LOCAL
from bentray_service.settings import ServiceSettings
from bentray_workers.cluster.connection import open_cluster
from bentray_workers.files.dataset import write_dataset
from bentray_workers.reconstruction import reconstruction_run

from ...kernels.tomography.waveform.scans import scan
from ..conftest import ENDED, HDF5

PATIENCE_S = 300.0
ASKED = {"method": "waveform", "nodes": 24, "iterations": 1, "minutes": 0.01}


@pytest.fixture
def http(tmp_path):
    settings = ServiceSettings(data_dir=tmp_path / "data")
    with (
        open_cluster(workers=2, local_directory=tmp_path, processes=False) as cluster,
        TestClient(create_app(settings, cluster), base_url="http://localhost") as client,
    ):
        yield client


@pytest.fixture
def torn(monkeypatch):
    """The scheduler goes once the waves have kept something; what was restored after it, by name."""
    store = reconstruction_run.Checkpoints
    restored, real_save, real_load = [], store.save, store.load
    gone = []

    def save(self, name, checkpoint):
        real_save(self, name, checkpoint)
        if not gone and type(checkpoint).__module__.startswith("bentray_kernels.tomography.waveform"):
            gone.append(name)
            raise CommClosedError("gone")

    def load(self, name):
        found = real_load(self, name)
        if found is not None:
            restored.append(name)
        return found

    monkeypatch.setattr(store, "save", save)
    monkeypatch.setattr(store, "load", load)
    return gone, restored


@pytest.mark.nightly
def test_interrupted_job_gives_the_bits_of_one_process(http, torn, tmp_path):
    write_dataset(tmp_path / "scan.h5", scan())
    sent = http.post("/v1/datasets", content=(tmp_path / "scan.h5").read_bytes(), headers=HDF5)
    asked = {"kind": "reconstruction", "dataset": sent.json()["id"], "settings": ASKED}
    job = http.post("/v1/jobs", json=asked).json()
    assert {
        "measure_traces",
        "examine_slice",
        "pick_emissions",
        "finish_slice",
        "write_picked",
        "start_band",
    } < set(job["plan"]["call_bytes"])
    deadline = time.monotonic() + PATIENCE_S
    while job["state"] not in ENDED:
        assert time.monotonic() < deadline
        time.sleep(0.05)
        job = http.get(f"/v1/jobs/{job['id']}").json()
    assert job["state"] == "succeeded", job["error"]
    gone, restored = torn
    assert set(gone) < set(restored), "rays and waves were gone on from"
    events = http.app.state.parts.jobs.events(LOCAL, job["id"])
    assert "no answer from the workers; the job continues when available" in {event.note for event in events}

    expected = reconstruct(
        replace(pick(scan()), waveform=scan().waveform), Settings.of(**{"method": "sart", **ASKED})
    )
    answer = http.get(f"/v1/volumes/{job['volume']}/data", params={"format": "npy"})
    np.testing.assert_array_equal(np.load(io.BytesIO(answer.content)).squeeze(), expected.speed)
    record = http.get(f"/v1/volumes/{job['volume']}").json()
    assert record["provenance"]["quality"] == "nothing found"
    assert record["provenance"]["waveform"] == expected.provenance["waveform"]
    assert any(sweep["band_hz"] for sweep in job["history"])

"""`bentray submit` while its service is killed and restarted: it waits, reports it and fetches the image."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset
from bentray_kernels.tomography import Settings, reconstruct
from bentray_workers.files.reconstruction import read_reconstruction

from .machine import PATIENCE_S, Machine, wait_until

pytestmark = [pytest.mark.slow, pytest.mark.nightly]


def test_submit_survives_a_service_restart(
    machine: Machine, scan: Dataset, scan_file: Path, tmp_path: Path
) -> None:
    before = {job["id"] for job in machine.http.get("/v1/jobs").json()["jobs"]}
    words = ["submit", str(scan_file), "--url", str(machine.http.base_url), "-o", str(tmp_path), "--json"]
    settings = ["--method", "sart", "--nodes", "64", "--iterations", "120"]
    with subprocess.Popen(
        [sys.executable, "-m", "bentray_service.cli", *words, *settings],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as submit:

        def running() -> list[str]:
            jobs = machine.http.get("/v1/jobs").json()["jobs"]
            return [job["id"] for job in jobs if job["id"] not in before and job["progress"]["done"] > 0]

        wait_until(running)
        machine.restart("service")
        stdout, stderr = submit.communicate(timeout=PATIENCE_S)
    assert submit.returncode == 0, stderr
    assert "retrying for up to 300 s." in stderr
    assert "The service answers again." in stderr
    jobs = machine.http.get("/v1/jobs").json()["jobs"]
    assert [job["id"] for job in jobs if job["id"] not in before] == [json.loads(stdout)["job"]]
    restored = read_reconstruction(tmp_path / "reconstruction.h5")
    np.testing.assert_array_equal(
        restored.speed, reconstruct(scan, Settings(method="sart", nodes=64, iterations=120)).speed
    )

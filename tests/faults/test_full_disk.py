"""A disk that fills up during a job: the job waits and continues once there is space."""

import sqlite3

import numpy as np
import pytest

from bentray_kernels.tomography import reconstruct
from bentray_kernels.tomography.stored_settings import from_stored
from bentray_workers.files.reconstruction import read_reconstruction

from ..small_disk import MIB, fill
from .machine import Machine, wait_until

pytestmark = [pytest.mark.slow, pytest.mark.nightly]

PLAN = {"nodes": 64, "attenuation": {"enabled": False}, "method": "sart", "iterations": 300}


def test_a_job_waits_for_room(tmp_path, small_disk, scan, scan_file):
    machine = Machine(tmp_path, 1, BENTRAY_DATA_DIR=str(small_disk), BENTRAY_MIN_FREE_BYTES=str(2 * MIB))
    try:
        machine.wait_ready()
        dataset = machine.upload(scan_file)
        job = machine.submit(dataset, **PLAN)
        wait_until(lambda: list(small_disk.glob(f"tenants/local/work/{job}/checkpoints/*.npz")))
        filler = fill(small_disk)
        # SQLite may have no room to say so before there is some.
        wait_until(lambda: not machine.http.get("/health/ready").is_success)
        wait_until(lambda: "the disk is full" in (tmp_path / "service.log").read_text())
        filler.unlink()
        assert machine.ended(job)["state"] == "succeeded"
        restored = read_reconstruction(
            small_disk / "tenants/local/volumes" / f"vol-{job.removeprefix('job-')}.h5"
        )
        assert np.array_equal(restored.speed, reconstruct(scan, from_stored(PLAN)).speed)
        with sqlite3.connect(small_disk / "bentray.sqlite") as database:
            notes = [note for (note,) in database.execute("SELECT note FROM events ORDER BY number")]
        assert "the disk is full; the job continues once there is space" in notes
        wait_until(lambda: machine.http.get("/health/ready").is_success)
    finally:
        machine.close()

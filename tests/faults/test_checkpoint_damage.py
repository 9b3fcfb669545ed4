"""A checkpoint damaged on disk is rejected, and the previous one is used."""

import numpy as np
import pytest

from bentray_kernels.tomography import reconstruct
from bentray_kernels.tomography.stored_settings import from_stored
from bentray_workers.files.reconstruction import read_reconstruction

from .machine import wait_until

pytestmark = [pytest.mark.slow, pytest.mark.nightly]

PLAN = {"nodes": 64, "attenuation": {"enabled": False}, "method": "sart", "iterations": 200}


def test_the_newest_checkpoint_is_flipped_while_the_service_is_dead(machine, scan, scan_file):
    job = machine.submit(machine.upload(scan_file), **PLAN)
    folder = machine.files / "work" / job / "checkpoints"
    wait_until(lambda: len(list(folder.glob("*.npz"))) == 2)
    machine.kill("service")
    older, newest = sorted(folder.glob("*.npz"))
    content = bytearray(newest.read_bytes())
    # Of the first of two equal arrays; in the middle are headers between them, which say nothing new.
    content[len(content) // 4] ^= 0x40
    newest.write_bytes(bytes(content))
    machine.start("service")
    assert machine.ended(job)["state"] == "succeeded"
    assert f"checkpoint {newest.name} is not used" in (machine.data.parent / "service.log").read_text()
    restored = read_reconstruction(machine.files / "volumes" / f"vol-{job.removeprefix('job-')}.h5")
    assert np.array_equal(restored.speed, reconstruct(scan, from_stored(PLAN)).speed)
    assert older.parent == folder
    wait_until(lambda: not folder.exists())

"""Network loss between the service and its workers: jobs continue with the same bits."""

import os
import shutil
import subprocess
import time

import numpy as np
import pytest

from bentray_kernels.tomography import reconstruct
from bentray_kernels.tomography.stored_settings import from_stored
from bentray_workers.files.reconstruction import read_reconstruction

from .machine import Machine, wait_until

pytestmark = [pytest.mark.slow, pytest.mark.nightly]

PLAN = {"nodes": 64, "attenuation": {"enabled": False}, "method": "sart", "iterations": 150}
CUT_S = 20.0


def ip(*words):
    return subprocess.run(["ip", *words], capture_output=True, text=True, check=False)


@pytest.fixture
def away():
    """A network namespace at the other end of a cable: its name, and the two addresses."""
    name = f"bentray-{os.getpid()}"
    if os.getuid() != 0 or shutil.which("ip") is None or ip("netns", "add", name).returncode != 0:
        pytest.skip("this machine does not let the test make a network namespace")
    here, there = f"bt{os.getpid() % 10**6}a", f"bt{os.getpid() % 10**6}b"
    try:
        steps = [
            ("link", "add", here, "type", "veth", "peer", "name", there, "netns", name),
            ("addr", "add", "10.213.7.1/30", "dev", here),
            ("link", "set", here, "up"),
            ("-n", name, "addr", "add", "10.213.7.2/30", "dev", there),
            ("-n", name, "link", "set", there, "up"),
            ("-n", name, "link", "set", "lo", "up"),
        ]
        for step in steps:
            made = ip(*step)
            if made.returncode:
                pytest.skip(f"this machine does not let the test make a network: {made.stderr.strip()}")
        yield name, here
    finally:
        ip("link", "del", here)
        ip("netns", "del", name)


class Apart(Machine):
    """The workers are in a namespace of their own."""

    host = "10.213.7.1"
    namespace = ""

    def _command(self, part):
        command = super()._command(part)
        return ["ip", "netns", "exec", self.namespace, *command] if part == "workers" else command


def test_a_cable_that_is_cut_for_a_while(tmp_path, away, scan, scan_file):
    Apart.namespace, cable = away
    # A worker that is silent for so long counts as dead; Dask's default is five minutes.
    machine = Apart(tmp_path, 1, DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL="8s")
    try:
        machine.wait_ready()
        job = machine.submit(machine.upload(scan_file), **PLAN)
        wait_until(lambda: machine.job(job)["progress"]["done"] > 0)
        ip("link", "set", cable, "down")
        time.sleep(CUT_S)
        assert machine.job(job)["state"] in ("running", "queued")
        ip("link", "set", cable, "up")
        assert machine.ended(job)["state"] == "succeeded"
        restored = read_reconstruction(machine.files / "volumes" / f"vol-{job.removeprefix('job-')}.h5")
        assert np.array_equal(restored.speed, reconstruct(scan, from_stored(PLAN)).speed)
    finally:
        machine.close()

"""SIGKILL of the service during an upload and during ingestion: received bytes are kept."""

import hashlib
import os
import signal
import subprocess
import sys
import threading
import time

import h5py
import httpx
import numpy as np
import pytest

from bentray_service.client import Client

from ..free_ports import free_port
from ..service.tus_records import PIECE, TUS
from .machine import wait_until

PATIENCE_S = 60.0
PROGRAM = (
    "import sys, uvicorn\n"
    "from bentray_service.app import create_app\n"
    "from bentray_service.settings import ServiceSettings\n"
    "class NoWorkers:\n    client = None\n"
    "uvicorn.run(create_app(ServiceSettings(), NoWorkers()), port=int(sys.argv[1]), log_level='warning')\n"
)


class Service:
    """A service of its own process on a folder and a port that stay."""

    def __init__(self, folder):
        self._port = free_port()
        self.url = f"http://127.0.0.1:{self._port}"
        self._environment = {**os.environ, "BENTRAY_DATA_DIR": str(folder)}

    def start(self, prelude=""):
        command = [sys.executable, "-c", prelude + PROGRAM, str(self._port)]
        self._process = subprocess.Popen(command, env=self._environment)
        wait_until(lambda: httpx.get(f"{self.url}/health/live").is_success)

    def kill(self):
        self._process.send_signal(signal.SIGKILL)
        self._process.wait()


def a_scan(path, megabytes):
    angle = 2 * np.pi * np.arange(32) / 32
    traces = np.random.default_rng(0).integers(-9, 9, (32, 32, megabytes * 500), dtype=np.int16)
    with h5py.File(path, "w") as file:
        file.attrs.update(format="uct-transmission", format_version="1.0", dimension=2)
        file["geometry/element_position_m"] = 0.1 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        file["acquisition/tx"] = file["acquisition/rx"] = np.arange(32)
        file["acquisition"].attrs["sampling_rate_hz"] = 1e7
        file.create_group("water").attrs["sound_speed_mps"] = 1500.0
        file["waveform/object"] = traces
    return path


@pytest.mark.nightly
@pytest.mark.slow
def test_upload_survives_a_service_kill(tmp_path):
    scan = a_scan(tmp_path / "scan.h5", 40)
    content = scan.read_bytes()
    service = Service(tmp_path / "data")
    service.start()
    try:
        headers = {**TUS, "Upload-Length": str(len(content))}
        location = httpx.post(f"{service.url}/v1/uploads", headers=headers).headers["location"]
        stored = tmp_path / "data" / "tenants" / "local" / "uploads" / location.rpartition("/")[2]

        def slowly():
            for at in range(0, len(content), 2**18):
                yield content[at : at + 2**18]
                time.sleep(0.005)

        def send():
            headers = {**PIECE, "Upload-Offset": "0"}
            try:
                httpx.patch(service.url + location, headers=headers, content=slowly(), timeout=PATIENCE_S)
            except httpx.TransportError:
                return
            raise AssertionError("it was to break")

        sender = threading.Thread(target=send)
        sender.start()
        wait_until(lambda: stored.exists() and stored.stat().st_size > 10_000_000)
        service.kill()
        sender.join()
        on_disk = stored.stat().st_size
        assert 10_000_000 < on_disk < len(content)
        assert stored.read_bytes() == content[:on_disk]
        service.start()
        head = httpx.head(service.url + location, headers=TUS)
        assert int(head.headers["upload-offset"]) == on_disk
        # The rest of it, and a kill while it is read.
        headers = {**PIECE, "Upload-Offset": str(on_disk)}
        sent = httpx.patch(
            service.url + location, headers=headers, content=content[on_disk:], timeout=PATIENCE_S
        )
        assert sent.status_code == 204
        incoming = tmp_path / "data" / "tenants" / "local" / "incoming"
        wait_until(lambda: list(incoming.glob("*.reading/*.partial")))
        assert httpx.get(service.url + location).json()["state"] == "reading"
        service.kill()
        assert stored.stat().st_size == len(content)
        service.start()
        with Client(service.url) as client:
            dataset = client.upload(scan, resume=location.rpartition("/")[2])
        assert dataset.sha256 == hashlib.sha256(content).hexdigest()
        assert not stored.exists()
        assert not list(incoming.iterdir())
    finally:
        service.kill()

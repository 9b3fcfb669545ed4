"""Upload of a scan of many gigabytes by tus, and peak memory of the service and of the reading process."""

import http.client
import shutil
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
import psutil

from ._http_load import connect

ELEMENTS = 256
SAMPLE_S = 0.1
READ_S = 7200.0
TUS = {"Tus-Resumable": "1.0.0"}


def large_scan(path: Path, size: float) -> Path:
    """Traces of about so many bytes that pack well: what is measured is moving and holding them."""
    samples = int(size / (2 * ELEMENTS**2))
    angle = 2 * np.pi * np.arange(ELEMENTS) / ELEMENTS
    wave = (1000 * np.sin(np.arange(samples) / 7)).astype(np.int16)
    with h5py.File(path, "w") as file:
        file.attrs.update(format="uct-transmission", format_version="1.0", dimension=2)
        file["geometry/element_position_m"] = 0.1 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        file["acquisition/tx"] = file["acquisition/rx"] = np.arange(ELEMENTS)
        file["acquisition"].attrs["sampling_rate_hz"] = 1e7
        file.create_group("water").attrs["sound_speed_mps"] = 1500.0
        traces = file.create_dataset("waveform/object", (ELEMENTS, ELEMENTS, samples), np.int16)
        for emitter in range(ELEMENTS):
            traces[emitter] = wave + np.int16(emitter)
    return path


@dataclass
class Sent:
    """How an upload went: bytes, seconds, memory of the service before, and the most of each process."""

    size: int
    sending_s: float
    reading_s: float
    idle_bytes: int
    service_bytes: int
    reader_bytes: int


@contextmanager
def watched(process: psutil.Process, most: dict[str, int]) -> Iterator[None]:
    """Keep the most memory that the service and its reader are seen to have."""
    stop = threading.Event()

    def look() -> None:
        while not stop.wait(SAMPLE_S):
            most["service"] = max(most["service"], process.memory_info().rss)
            for child in process.children(recursive=True):
                try:
                    if "bentray_service.ingest.child" in child.cmdline():
                        most["reader"] = max(most["reader"], child.memory_info().rss)
                except psutil.Error:
                    continue

    thread = threading.Thread(target=look)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


def send(url: str, process: psutil.Process, path: Path) -> Sent:
    """Upload a file and wait until it is read.

    Raises:
        RuntimeError: when it is refused.
    """
    size, idle, most = path.stat().st_size, process.memory_info().rss, {"service": 0, "reader": 0}
    connection = connect(url)
    connection.timeout = READ_S
    # So that both read and write large pieces.
    connection.blocksize = 2**20
    with watched(process, most):
        length = {**TUS, "Upload-Length": str(size)}
        location = _asked(connection, "POST", "/v1/uploads", length).headers["Location"]
        headers = {**TUS, "Content-Type": "application/offset+octet-stream", "Upload-Offset": "0"}
        begun = time.perf_counter()
        with path.open("rb") as file:
            connection.request("PATCH", location, file, {**headers, "Content-Length": str(size)})
            answer = connection.getresponse()
            answer.read()
        sent = time.perf_counter()
        if answer.status != 204:
            raise RuntimeError(f"the upload was answered with {answer.status}")
        while True:
            there = _asked(connection, "HEAD", location, TUS).headers
            if there["Bentray-State"] in ("done", "refused"):
                break
            time.sleep(SAMPLE_S)
        read = time.perf_counter()
    if there["Bentray-State"] != "done":
        raise RuntimeError("the upload was refused")
    _asked(connection, "DELETE", there["Bentray-Result"], {})
    connection.close()
    return Sent(size, sent - begun, read - sent, idle, most["service"], most["reader"])


def room_for(folder: Path, size: float) -> bool:
    """Whether file, upload and canonical copy have room, with a tenth of the disk left."""
    usage = shutil.disk_usage(folder)
    return usage.free - 3 * size > 0.1 * usage.total


def _asked(
    connection: http.client.HTTPConnection, method: str, path: str, headers: dict[str, str]
) -> http.client.HTTPResponse:
    connection.request(method, path, headers=headers)
    answer = connection.getresponse()
    answer.read()
    if answer.status >= 400:
        raise RuntimeError(f"{method} {path} was answered with {answer.status}")
    return answer

"""Upload of a scan of many gigabytes by tus, and peak memory of the service and of the reading process."""

import shutil
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from http.client import HTTPConnection, HTTPResponse
from pathlib import Path
from typing import BinaryIO

import h5py
import numpy as np
import psutil

from ._http_load import asked, beside, connect

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

    def look(stop: threading.Event) -> None:
        while not stop.wait(SAMPLE_S):
            most["service"] = max(most["service"], process.memory_info().rss)
            for child in process.children(recursive=True):
                try:
                    if "bentray_service.ingest.child" in child.cmdline():
                        most["reader"] = max(most["reader"], child.memory_info().rss)
                except psutil.Error:
                    continue

    with beside([look]):
        yield


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
        location = _accepted(connection, "POST", "/v1/uploads", length).headers["Location"]
        headers = {**TUS, "Content-Type": "application/offset+octet-stream", "Upload-Offset": "0"}
        begun = time.perf_counter()
        with path.open("rb") as file:
            _accepted(connection, "PATCH", location, {**headers, "Content-Length": str(size)}, file)
        sent = time.perf_counter()
        while True:
            there = _accepted(connection, "HEAD", location, TUS).headers
            if there["Bentray-State"] in ("done", "refused"):
                break
            time.sleep(SAMPLE_S)
        read = time.perf_counter()
    if there["Bentray-State"] != "done":
        raise RuntimeError("the upload was refused")
    _accepted(connection, "DELETE", there["Bentray-Result"], {})
    connection.close()
    return Sent(size, sent - begun, read - sent, idle, most["service"], most["reader"])


def room_for(folder: Path, size: float) -> bool:
    """Whether file, upload and canonical copy have room, with a tenth of the disk left."""
    usage = shutil.disk_usage(folder)
    return usage.free - 3 * size > 0.1 * usage.total


def _accepted(
    connection: HTTPConnection, method: str, path: str, headers: dict[str, str], body: BinaryIO | None = None
) -> HTTPResponse:
    answer = asked(connection, method, path, body, headers)
    if answer.status >= 400:
        raise RuntimeError(f"{method} {path} was answered with {answer.status}")
    return answer

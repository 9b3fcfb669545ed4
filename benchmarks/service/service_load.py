"""The service under load: large uploads, slow clients, requests during a job, short jobs beside long ones."""

import http.client
import os
import socket
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from urllib.parse import urlsplit

import psutil

from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step
from bentray_service.client import Client

from ..shared._synthetic_scan import made_up_scan
from ._http_load import Calls, asked, beside, connect, got, load, served
from ._large_upload import TUS, large_scan, room_for, send
from ._short_jobs import SETTINGS as TWO_TENANTS
from ._short_jobs import short_jobs

GIGABYTE = 1e9
SIZES, QUICK_SIZES = (1.0, 10.0), (0.2,)
CALLERS = 8
# Connections that send one byte a second of a large body, and its bytes.
SLOW, ANNOUNCED_BYTES = 100, 10**6
SETTINGS = {"BENTRAY_MAX_UPLOAD_BYTES": str(2**36), "BENTRAY_WORKERS": "1"}


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """All rows, with the load that they began under; ``quick`` takes less of everything."""
    busy = os.getloadavg()[0]
    with served(SETTINGS) as (url, folder):
        process = next(child for child in psutil.Process().children() if "serve" in child.cmdline())
        for row in measured(url, process, folder, context.quick, context.progress):
            yield replace(row, detail=f"{row.detail}; load average {busy:.1f} at the start")
    context.progress(3, 4, "short jobs")
    with served(TWO_TENANTS) as (url, folder):
        yield from short_jobs(url, folder, quick=context.quick)


def measured(url: str, process: psutil.Process, folder: Path, quick: bool, progress: Step) -> Iterator[Row]:
    seconds = 4.0 if quick else 20.0
    progress(0, 4, "large uploads")
    for gigabytes in QUICK_SIZES if quick else SIZES:
        yield from large_upload(url, process, folder, gigabytes)
    progress(1, 4, "slow clients")
    yield from slow_clients(url, seconds)
    progress(2, 4, "beside a reconstruction")
    yield from beside_work(url, folder, seconds, quick)


def slow_clients(url: str, seconds: float) -> Iterator[Row]:
    """99th percentile of ``/health/live`` while clients send a byte a second to both kinds of upload."""
    one_shot = ("POST", "/v1/datasets", {"Content-Type": "application/x-hdf5"})
    with closing(connect(url)) as connection:
        length = {**TUS, "Upload-Length": str(ANNOUNCED_BYTES)}
        begun = [
            asked(connection, "POST", "/v1/uploads", None, length).headers["Location"] for _ in range(SLOW)
        ]
    piece = {**TUS, "Content-Type": "application/offset+octet-stream", "Upload-Offset": "0"}
    pieces = [("PATCH", path, piece) for path in begun]
    for name, requests in (("one-shot uploads", [one_shot] * SLOW), ("pieces by tus", pieces)):
        with dripping(url, requests):
            calls = load(url, 2, lambda connection, number: got(connection, "/health/live"), seconds, 0.01)
        detail = f"{SLOW} clients with a byte a second at {name}; health: {calls}"
        yield Row(f"health beside slow {name}, p99", p99_ms(calls), 200.0, "<", "ms", detail)
    # A tenant has no more incomplete uploads than these.
    with closing(connect(url)) as connection:
        for path in begun:
            asked(connection, "DELETE", path, None, TUS)


@contextmanager
def dripping(url: str, requests: list[tuple[str, str, Mapping[str, str]]]) -> Iterator[None]:
    """Hold one connection for each ``(method, path, headers)``, each sending a byte a second."""
    address = urlsplit(url)
    with ExitStack() as stack:
        connections = []
        for method, path, headers in requests:
            connection = stack.enter_context(socket.create_connection((address.hostname, address.port)))
            lines = {"Host": address.netloc, "Content-Length": str(ANNOUNCED_BYTES), **headers}
            head = "".join(f"{name}: {value}\r\n" for name, value in lines.items())
            connection.sendall(f"{method} {path} HTTP/1.1\r\n{head}\r\n".encode())
            connections.append(connection)

        def drip(stop: threading.Event) -> None:
            while not stop.wait(1.0):
                for connection in connections:
                    with suppress(OSError):
                        connection.sendall(b"x")

        with beside([drip]):
            yield


def beside_work(url: str, folder: Path, seconds: float, quick: bool) -> Iterator[Row]:
    """Requests a second and their 99th percentile while the one worker reconstructs."""
    nodes, elements, slices = (64, 64, 4) if quick else (128, 256, 16)
    with Client(url) as client:
        small = client.upload(made_up_scan(folder / "small.h5", elements, 1)).id
        done = client.wait(client.submit(small, {"nodes": nodes, "iterations": 1}).id)
        picture = f"/v1/volumes/{done.volume}/slice.png"
        several = client.upload(made_up_scan(folder / "several.h5", elements, slices)).id
        job = client.submit(several, {"nodes": nodes, "iterations": 1000, "method": "sart"}).id
        content = made_up_scan(folder / "sent.h5", 64, 1).read_bytes()

        def upload(connection: http.client.HTTPConnection, number: int) -> bool:
            headers = {"Content-Type": "application/x-hdf5"}
            return asked(connection, "POST", "/v1/datasets", content, headers).status == 201

        ways = (
            ("status polls", CALLERS, lambda c, k: got(c, f"/v1/jobs/{job}"), 100.0, 200.0),
            # The range differs from picture to picture, so that none is drawn before.
            ("slice images", 2, lambda c, k: got(c, f"{picture}?low=1000&high={1600 + k}"), 2.0, 1000.0),
            (f"uploads of {len(content) // 1000} kB", 2, upload, 0.5, 10_000.0),
        )
        for name, callers, call, goal, most_ms in ways:
            calls = load(url, callers, call, seconds)
            state = client.job(job).state
            detail = f"{callers} callers, {calls}; beside a reconstruction of {slices} slices of {nodes}², "
            detail += f"{elements} transducers, {state} at the end"
            good = not calls.failed and state == "running"
            yield Row(f"{name} a second", calls.per_second if good else None, goal, ">=", "1/s", detail)
            yield Row(f"{name}, p99", p99_ms(calls) if good else None, most_ms, "<", "ms", detail)
        client.cancel(job)


def large_upload(url: str, process: psutil.Process, folder: Path, gigabytes: float) -> Iterator[Row]:
    """S1: how fast a large scan comes in, and the memory that it takes to receive and to read it."""
    names = f"S1 upload of {gigabytes:g} GB", f"S1 memory, upload of {gigabytes:g} GB"
    if not room_for(folder, gigabytes * GIGABYTE):
        for name, goal, op, unit in ((names[0], 200.0, ">=", "MB/s"), (names[1], 300.0, "<", "MB")):
            yield Row(name, None, goal, op, unit, "the disk has no room for it three times")
        return
    path = large_scan(folder / "large.h5", gigabytes * GIGABYTE)
    sent = send(url, process, path)
    path.unlink()
    how = (
        f"{sent.size / 1e9:.2f} GB in {sent.sending_s:.1f} s to the disk, read in {sent.reading_s:.0f} s more"
    )
    yield Row(names[0], sent.size / 1e6 / sent.sending_s, 200.0, ">=", "MB/s", f"one PATCH by tus; {how}")
    most = max(sent.service_bytes, sent.reader_bytes)
    detail = f"resident, service {sent.service_bytes / 1e6:.0f} MB, from {sent.idle_bytes / 1e6:.0f} MB "
    detail += f"idle; process that reads {sent.reader_bytes / 1e6:.0f} MB; traces that pack well"
    yield Row(names[1], most / 1e6, 300.0, "<", "MB", detail)


def p99_ms(calls: Calls) -> float | None:
    return None if calls.failed else 1e3 * calls.percentile(99)

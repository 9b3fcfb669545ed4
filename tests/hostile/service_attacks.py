"""Attacks on one service with keys: lies in headers, plans, exports, flipped bits, connections, the clock."""

from __future__ import annotations

import hashlib
import io
import os
import threading
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from socket import create_connection
from typing import Any

import httpx
import numpy as np
import psutil

from bentray_workers.files.export.registry import EXPORTED as FORMATS
from bentray_workers.rendering.picture_cost import VolumeFile, export_cost

from ..edge import edge
from ..faults.live_service import LiveService
from ..faults.machine import ENDED, wait_until
from .attack_table import Attack
from .raw_http import exchange

MIB = 2**20
MALLORY, ADA = "mallory", "ada"
STREAM = {"Content-Type": "application/octet-stream"}
TUS = {"Tus-Resumable": "1.0.0"}
PIECE = {**TUS, "Content-Type": "application/offset+octet-stream"}
SMALL = {"nodes": 32, "method": "sart", "iterations": 3, "attenuation": {"enabled": False}}
# A job that goes on until it is cancelled.
ENDLESS = {**SMALL, "nodes": 128, "iterations": 1000}
# Seconds in which a service under attack must answer others. Other programs may use the machine.
PROMPT_S = 5.0
# Most by which the service may grow, MiB, in an attack that is to cost it nothing.
GROWTH_MIB = 96.0
SIDE = 224
DAY_S = 86400.0
# Imported by every Python of the service: the clock of the file, which this program changes.
CLOCK = """
import os, time
_real, _path = time.time, os.environ["BENTRAY_TEST_CLOCK"]
def _now():
    try:
        with open(_path) as file:
            return _real() + float(file.read() or 0.0)
    except (OSError, ValueError):
        return _real()
time.time = _now
"""


class Victim:
    """A service with a hostile and an honest tenant, and a clock that can be set.

    Args:
        folder: for data and logs.
        fronted: whether they reach it through nginx.
    """

    def __init__(self, folder: Path, *, fronted: bool = False) -> None:
        (folder / "clock").mkdir(parents=True)
        (folder / "clock" / "sitecustomize.py").write_text(CLOCK)
        self._offset = folder / "offset"
        self.set_clock(0.0)
        path = os.pathsep.join(filter(None, (str(folder / "clock"), os.environ.get("PYTHONPATH"))))
        self.service = LiveService(
            folder,
            (MALLORY, ADA),
            BENTRAY_TEST_CLOCK=str(self._offset),
            BENTRAY_KEEP_DAYS="30",
            BENTRAY_MIN_FREE_BYTES="0",
            PYTHONPATH=path,
        )
        self._closing = ExitStack()
        self._closing.callback(self.service.kill)
        self.port = self.service.port
        if fronted:
            self.port = self._closing.enter_context(edge(folder / "edge", self.port)).port
        self.http = {who: self._client(who) for who in (MALLORY, ADA)}
        self.own = f"Authorization: Bearer {self.service.keys[MALLORY]}"

    def _client(self, who: str) -> httpx.Client:
        headers = {"Authorization": f"Bearer {self.service.keys[who]}"}
        return httpx.Client(base_url=f"http://127.0.0.1:{self.port}", headers=headers, timeout=120.0)

    def set_clock(self, offset_s: float) -> None:
        new = self._offset.with_suffix(".new")
        new.write_text(repr(offset_s))
        new.replace(self._offset)

    def rss_mib(self) -> float:
        return float(psutil.Process(self.service.process.pid).memory_info().rss / MIB)

    def workers_mib(self) -> float:
        return max(psutil.Process(pid).memory_info().rss / MIB for pid in self.service.worker_pids())

    def upload(self, who: str, place: str, content: bytes) -> str:
        answer = self.http[who].post(f"/v1/{place}", content=content, headers=STREAM)
        assert answer.status_code == 201, answer.text
        return str(answer.json()["id"])

    def submit(self, who: str, dataset: str, settings: dict[str, Any]) -> str:
        asked = {"kind": "reconstruction", "dataset": dataset, "settings": settings}
        answer = self.http[who].post("/v1/jobs", json=asked)
        assert answer.status_code == 202, answer.text
        return str(answer.json()["id"])

    def ended(self, who: str, job: str) -> dict[str, Any]:
        def record() -> dict[str, Any] | None:
            found: dict[str, Any] = self.http[who].get(f"/v1/jobs/{job}").json()
            return found if found["state"] in ENDED else None

        found: dict[str, Any] = wait_until(record)
        return found

    def check_alive(self) -> str:
        """The honest tenant is answered promptly."""
        begun = time.monotonic()
        assert self.http[ADA].get("/v1/jobs").status_code == 200
        seconds = time.monotonic() - begun
        assert seconds < PROMPT_S, f"an honest request took {seconds:.1f} s"
        return f"honest request {seconds:.2f} s"

    @contextmanager
    def cheap(self) -> Iterator[None]:
        """The service grows by little within the block, and answers others promptly after it."""
        before = self.rss_mib()
        yield
        self.check_alive()
        grown = self.rss_mib() - before
        assert grown < GROWTH_MIB, f"the service grew by {grown:.0f} MiB"

    def close(self) -> None:
        for one in self.http.values():
            one.close()
        self._closing.close()


def service_attacks(victim: Victim, scan: bytes) -> list[Attack]:
    """All of them, the clock last."""
    return [
        Attack(
            "Content-Length of 10 TB, of 10^30", "413 or 400 before the body", lambda: huge_length(victim)
        ),
        Attack(
            "Content-Length negative, twice, with chunks",
            "400, closed",
            lambda: contradictory_lengths(victim),
        ),
        Attack("Content-Length beyond the body", "nothing stored", lambda: too_long_length(victim, scan)),
        Attack(
            "a request hidden behind the body", "its own answer, 401", lambda: hidden_request(victim, scan)
        ),
        Attack(
            "Upload-Length, Upload-Offset out of range", "409, 413 or 422", lambda: upload_lengths(victim)
        ),
        Attack(
            "ranges beyond, reversed, 5000 of them", "206, 416 or the whole", lambda: ranges(victim, scan)
        ),
        Attack("plans of gigabytes", "422 or a plan, no memory", lambda: plans(victim, scan)),
        Attack(f"all exports of {SIDE}³ by four clients", "memory of the plan", lambda: exports(victim)),
        Attack("a bit of stored files flipped", "500 stored-data-damaged", lambda: flipped(victim, scan)),
        Attack(
            "a bit of half an upload flipped", "another sha256, or 422", lambda: flipped_upload(victim, scan)
        ),
        Attack("100 event streams", "64, the others 429", lambda: streams(victim, scan)),
        Attack("200 idle connections", "others are answered", lambda: idle(victim)),
        Attack("clock 400 days ahead, then 2 years back", "nothing deleted", lambda: clock(victim, scan)),
    ]


def huge_length(victim: Victim) -> str:
    found = []
    with victim.cheap():
        for path in ("/v1/datasets", "/v1/volumes?spacing_m=0.001", "/v1/jobs"):
            for length in (10**13, 10**30):
                head = [f"POST {path} HTTP/1.1", victim.own, f"Content-Length: {length}", "Content-Type: x/y"]
                statuses, _ = exchange(victim.port, head, bytes(100), ends=False)
                found += statuses[:1]
                assert statuses
                assert statuses[0] in (400, 413, 415, 422), statuses
    return _counted(found)


def contradictory_lengths(victim: Victim) -> str:
    found = []
    for lines in (
        ("Content-Length: -1",),
        ("Content-Length: 5", "Content-Length: 6"),
        ("Content-Length: 5", "Transfer-Encoding: chunked"),
        ("Content-Length: 0x10",),
        ("Content-Length: 5, 5",),
        ("Transfer-Encoding: chunked, identity",),
    ):
        head = ["POST /v1/jobs HTTP/1.1", victim.own, "Content-Type: application/json", *lines]
        body = b"5\r\nhello\r\n0\r\n\r\nGET /v1/jobs HTTP/1.1\r\n\r\n"
        statuses, _ = exchange(victim.port, head, body, ends=False)
        found += statuses[:1]
        assert statuses[:1] in ([400], [501], [422]), (lines, statuses)
        # What follows is not taken for a request of this caller.
        assert 200 not in statuses, (lines, statuses)
    victim.check_alive()
    return _counted(found)


def too_long_length(victim: Victim, scan: bytes) -> str:
    head = ["POST /v1/datasets HTTP/1.1", victim.own, f"Content-Length: {2 * len(scan)}", *_lines(STREAM)]
    statuses, _ = exchange(victim.port, head, scan)
    assert set(statuses) <= {400, 408}, statuses
    wait_until(lambda: not victim.http[MALLORY].get("/v1/datasets").json()["datasets"])
    incoming = victim.service.data / "tenants" / MALLORY / "incoming"
    wait_until(lambda: not incoming.exists() or not list(incoming.iterdir()))
    return f"{_counted(statuses) or 'closed'}; no scan, no file"


def hidden_request(victim: Victim, scan: bytes) -> str:
    """Beyond the announced length of a body stands a request without a key."""
    hidden = b"GET /v1/datasets HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
    head = ["POST /v1/datasets HTTP/1.1", victim.own, f"Content-Length: {len(scan)}", *_lines(STREAM)]
    statuses, _ = exchange(victim.port, head, scan + hidden, ends=False)
    assert statuses in ([201, 401], [201]), statuses
    (made,) = victim.http[MALLORY].get("/v1/datasets").json()["datasets"]
    assert victim.http[MALLORY].delete(f"/v1/datasets/{made['id']}").status_code == 204
    return _counted(statuses)


def upload_lengths(victim: Victim) -> str:
    found = []
    http = victim.http[MALLORY]
    for length in ("0", "-1", str(2**63), "1" + 400 * "0", "1e9", str(2**62), ""):
        answer = http.post("/v1/uploads", headers={**TUS, "Upload-Length": length})
        assert answer.status_code in (400, 413, 422, 507), (length, answer.text)
        found.append(answer.status_code)
    begun = http.post("/v1/uploads", headers={**TUS, "Upload-Length": "100"})
    place = begun.headers["location"]
    for offset in ("1", "-1", str(2**63), "99999999999999999999", "x", "100"):
        answer = http.patch(place, headers={**PIECE, "Upload-Offset": offset}, content=b"a")
        assert answer.status_code in (400, 409, 422), (offset, answer.text)
        found.append(answer.status_code)
    answer = http.patch(place, headers={**PIECE, "Upload-Offset": "0"}, content=bytes(200))
    assert answer.status_code == 413, answer.text
    assert http.head(place, headers=TUS).headers["upload-offset"] == "0"
    assert http.delete(place, headers=TUS).status_code == 204
    return _counted([*found, 413])


def ranges(victim: Victim, scan: bytes) -> str:
    dataset = victim.upload(MALLORY, "datasets", scan)
    http, found = victim.http[MALLORY], []
    path = f"/v1/datasets/{dataset}/file"
    whole = http.get(path).content
    many = ",".join(f"{k}-{k + 1}" for k in range(5000))
    with victim.cheap():
        for asked in (
            f"bytes=0-{10**18}",
            f"bytes={10**18}-",
            "bytes=9-3",
            "bytes=-0",
            f"bytes=-{10**18}",
            "bytes=--5",
            "bytes=0-,0-,0-,0-,0-,0-,0-,0-",
            f"bytes={many[:8000]}",
            "lines=1-2",
            "bytes=" + "9" * 400 + "-",
        ):
            answer = http.get(path, headers={"Range": asked})
            found.append(answer.status_code)
            assert answer.status_code in (200, 206, 400, 416), (asked[:60], answer.status_code)
            assert len(answer.content) <= 2 * len(whole) + 4096, (asked[:60], len(answer.content))
            if answer.status_code == 200:
                assert answer.content == whole
    http.delete(f"/v1/datasets/{dataset}")
    return _counted(found)


def plans(victim: Victim, scan: bytes) -> str:
    dataset = victim.upload(MALLORY, "datasets", scan)
    simulations: tuple[dict[str, Any], ...] = (
        {"nodes": 1024, "elements": 4096, "refinement": 64},
        {"phantom": "table7", "three_d": True, "nodes": 1024, "elements": 4096, "slices": 1000},
        {"phantom": "table7", "array": "rings", "nodes": 1024, "elements": 4096, "slices": 500},
        {"waveform": True, "frequency_hz": 1e7, "side_m": 1.0, "elements": 4096, "emissions": 4096},
        {"waveform": True, "phantom": "table7", "frequency_hz": 1e6, "side_m": 1.0},
    )
    reconstructions: tuple[dict[str, Any], ...] = (
        {"nodes": 4096},
        {"nodes": 1024, "iterations": 10**6, "resolution_check": True, "uncertainty": True},
        {"decomposition": "volume", "nodes": 1024},
        {"method": "waveform", "minutes": 10**6},
    )
    found, slowest = [], 0.0
    asked = [{"kind": "simulation", "settings": one} for one in simulations]
    asked += [{"kind": "reconstruction", "dataset": dataset, "settings": one} for one in reconstructions]
    with victim.cheap():
        for one in asked:
            begun = time.monotonic()
            answer = victim.http[MALLORY].post("/v1/plans", json=one)
            slowest = max(slowest, time.monotonic() - begun)
            assert answer.status_code in (200, 422), (one, answer.text[:300])
            found.append(answer.status_code)
            assert slowest < 2 * PROMPT_S, (one, slowest)
    victim.http[MALLORY].delete(f"/v1/datasets/{dataset}")
    return f"{_counted(found)}; slowest {slowest:.1f} s"


def exports(victim: Victim) -> str:
    """Memory while four clients get the same large volume in every format at once."""
    content = io.BytesIO()
    np.save(content, np.random.default_rng(0).random((SIDE,) * 3, np.float32))
    volume = victim.upload(MALLORY, "volumes?spacing_m=0.001", content.getvalue())
    volume_mib, stored = 4 * SIDE**3 / MIB, VolumeFile((SIDE,) * 3, 6)
    planned_mib = max(export_cost(stored, name).bytes for name in FORMATS) / MIB
    before, peaks, leaving = (victim.rss_mib(), victim.workers_mib()), [0.0, 0.0], threading.Event()

    def watch() -> None:
        while not leaving.wait(0.05):
            with suppress(psutil.Error, ValueError):
                peaks[:] = max(peaks[0], victim.rss_mib()), max(peaks[1], victim.workers_mib())

    def get(name: str) -> int:
        with victim.http[MALLORY].stream("GET", f"/v1/volumes/{volume}/data?format={name}") as answer:
            for _ in answer.iter_bytes():
                pass
            return answer.status_code

    watcher = threading.Thread(target=watch)
    watcher.start()
    try:
        with ThreadPoolExecutor(4) as pool:
            found = list(pool.map(get, FORMATS))
    finally:
        leaving.set()
        watcher.join()
    assert set(found) <= {200, 422}, dict(zip(FORMATS, found, strict=True))
    grown = peaks[0] - before[0], peaks[1] - before[1]
    assert grown[0] < GROWTH_MIB, f"the service grew by {grown[0]:.0f} MiB"
    # Of the format that takes most; the allocator keeps some of it for the next one.
    assert grown[1] < planned_mib, f"a worker grew by {grown[1]:.0f} MiB, planned for {planned_mib:.0f}"
    victim.http[MALLORY].delete(f"/v1/volumes/{volume}")
    mib = f"service +{max(0.0, grown[0]):.0f}, worker +{max(0.0, grown[1]):.0f} of {planned_mib:.0f} MiB"
    return f"{_counted(found)}; {mib}, volume {volume_mib:.0f}"


def flipped(victim: Victim, scan: bytes) -> str:
    """One bit in the middle of the file of each kind of item, after it was used."""
    http, folder = victim.http[MALLORY], victim.service.data / "tenants" / MALLORY
    dataset = victim.upload(MALLORY, "datasets", scan)
    job = victim.ended(MALLORY, victim.submit(MALLORY, dataset, SMALL))
    volume = job["volume"]
    assert http.get(f"/v1/volumes/{volume}/data?format=nifti").status_code == 200
    asked = {
        f"datasets/{dataset}.h5": (f"/v1/datasets/{dataset}/file", f"/v1/datasets/{dataset}/quality"),
        f"volumes/{volume}.h5": (
            f"/v1/volumes/{volume}/data",
            f"/v1/volumes/{volume}/slice.png?low=1400&high=1601",
        ),
    }
    exported = [path for path in (folder / "exports").rglob("*") if path.is_file()]
    assert exported
    asked[str(exported[0].relative_to(folder))] = (f"/v1/volumes/{volume}/data?format=nifti",)
    found = []
    for name, paths in asked.items():
        _flip(folder / name)
        for path in paths:
            answer = http.get(path)
            # An export is made again from a sound volume.
            made_again = name.startswith("exports") and answer.status_code == 200
            damaged = answer.status_code == 500 and answer.json()["type"].endswith("stored-data-damaged")
            assert damaged or made_again, (name, path, answer.status_code, answer.text[:200])
            found.append(answer.status_code)
    again = http.post("/v1/jobs", json={"kind": "reconstruction", "dataset": dataset, "settings": SMALL})
    if again.status_code == 202:
        ended = victim.ended(MALLORY, again.json()["id"])
        assert ended["state"] == "failed", ended
        assert ended["error"]["type"].endswith("stored-data-damaged"), ended["error"]
    else:
        assert again.json()["type"].endswith("stored-data-damaged"), again.text
    for path in (f"/v1/volumes/{volume}", f"/v1/datasets/{dataset}"):
        http.delete(path)
    return f"{_counted(found)}, and a job of the scan failed"


def flipped_upload(victim: Victim, scan: bytes) -> str:
    """A bit that changes on the disk between two pieces."""
    http = victim.http[MALLORY]
    place = http.post("/v1/uploads", headers={**TUS, "Upload-Length": str(len(scan))}).headers["location"]
    half = len(scan) // 2
    http.patch(place, headers={**PIECE, "Upload-Offset": "0"}, content=scan[:half])
    _flip(victim.service.data / "tenants" / MALLORY / "uploads" / place.rpartition("/")[2])
    http.patch(place, headers={**PIECE, "Upload-Offset": str(half)}, content=scan[half:])
    record = wait_until(
        lambda: one if (one := http.get(place).json())["state"] in ("done", "refused") else None
    )
    if record["state"] == "refused":
        return f"refused: {record['problem']['field']}"
    made = http.get(f"/v1/datasets/{record['result']}").json()
    assert made["sha256"] != hashlib.sha256(scan).hexdigest()
    http.delete(f"/v1/datasets/{made['id']}")
    return "done, with the sha256 of what was stored"


def streams(victim: Victim, scan: bytes) -> str:
    dataset = victim.upload(MALLORY, "datasets", scan)
    job = victim.submit(MALLORY, dataset, ENDLESS)
    others = victim.upload(ADA, "datasets", scan)
    found: list[int] = []
    with ExitStack() as stack:
        for _ in range(100):
            client = stack.enter_context(victim._client(MALLORY))
            stream = stack.enter_context(client.stream("GET", f"/v1/jobs/{job}/events"))
            found.append(stream.status_code)
        assert Counter(found) == {200: 64, 429: 36}, Counter(found)
        alive = victim.check_alive()
        with victim.http[ADA].stream("GET", "/v1/events?seconds=1") as own:
            assert own.status_code == 200
        honest = victim.ended(ADA, victim.submit(ADA, others, SMALL))
        assert honest["state"] == "succeeded", honest
    victim.http[MALLORY].post(f"/v1/jobs/{job}/cancel")
    victim.ended(MALLORY, job)
    victim.http[ADA].delete(f"/v1/datasets/{others}")
    victim.http[MALLORY].delete(f"/v1/datasets/{dataset}")
    return f"{_counted(found)}; {alive}, an honest job ended"


def idle(victim: Victim) -> str:
    with ExitStack() as stack, victim.cheap():
        for _ in range(200):
            stack.enter_context(create_connection(("127.0.0.1", victim.port), 10.0))
        alive = victim.check_alive()
        with victim._client(ADA) as late:
            assert late.get("/health/live").status_code == 200
    return alive


def clock(victim: Victim, scan: bytes) -> str:
    """Data kept for 30 days, a running job, half an upload and a key, while the clock jumps."""
    http = victim.http[MALLORY]
    dataset = victim.upload(MALLORY, "datasets", scan)
    done = victim.ended(MALLORY, victim.submit(MALLORY, dataset, SMALL))
    place = http.post("/v1/uploads", headers={**TUS, "Upload-Length": str(len(scan))}).headers["location"]
    http.patch(place, headers={**PIECE, "Upload-Offset": "0"}, content=scan[:100])
    job = victim.submit(MALLORY, dataset, ENDLESS)
    wait_until(lambda: http.get(f"/v1/jobs/{job}").json()["state"] == "running")
    for offset_s in (400 * DAY_S, -730 * DAY_S):
        victim.set_clock(offset_s)
        # Leases are renewed every five seconds, and a sweep comes every minute.
        time.sleep(70.0)
        assert http.get(f"/v1/datasets/{dataset}").status_code == 200
        assert http.get(f"/v1/volumes/{done['volume']}/slice.png").status_code == 200
        assert http.get(f"/v1/jobs/{job}").json()["state"] == "running", http.get(f"/v1/jobs/{job}").json()
        quick = victim.ended(MALLORY, victim.submit(MALLORY, dataset, SMALL))
        assert quick["state"] == "succeeded", quick
    victim.set_clock(0.0)
    states = httpx_events(victim, job)
    assert states == ["queued", "running", "cancelling", "cancelled"], states
    upload = http.head(place, headers=TUS).headers.get("upload-offset")
    assert upload == "100", upload
    return "scan, volume, upload and running job are there; jobs ended"


def httpx_events(victim: Victim, job: str) -> list[str]:
    """The states of a job from its beginning to its cancellation."""
    victim.http[MALLORY].post(f"/v1/jobs/{job}/cancel")
    victim.ended(MALLORY, job)
    text = victim.http[MALLORY].get(f"/v1/jobs/{job}/events").text
    return [
        line.partition('"state": "')[2].partition('"')[0] for line in text.splitlines() if '"note"' in line
    ]


def _flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0x10
    path.write_bytes(bytes(content))


def _lines(headers: dict[str, str]) -> list[str]:
    return [f"{name}: {value}" for name, value in headers.items()]


def _counted(statuses: list[int]) -> str:
    return ", ".join(f"{count}x {status}" for status, count in sorted(Counter(statuses).items()))

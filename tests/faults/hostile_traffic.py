"""Hostile requests: oversize, malformed, unauthenticated, or for objects of other tenants."""

import itertools
import random
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from bentray_workers.files.dataset import write_dataset

from ..service.ingest import hostile_datasets, hostile_meshes, hostile_variants, hostile_volumes
from ..service.tus_records import PIECE, TUS
from ..workers.files.datasets import small
from .hostile_connections import FROM, HostileConnections
from .ledger import Ledger

STREAM = {"Content-Type": "application/octet-stream"}
JSON = {"Content-Type": "application/json"}
# How long an answer is waited for; whoever is late is left.
PATIENCE_S = 60.0
HUGE = 10**400
# Scans that spoil a sound file in ways that cost most.
SCANS = ("external storage", "virtual", "records", "terabytes", "16 GiB of zeros", "zstandard", "a PNG")
EXPENSIVE = (
    "width=4096&height=4096&iso=0.5",
    "width=512&height=512&depth=16&fresnel=true&iso=0.5",
    "width=4096&height=4096&depth=16&fresnel=true&iso=0.5",
)
MAX_WAIT_S = 2.0
PLACES = {"dataset": "datasets", "volume": "volumes", "mesh": "meshes"}
QUOTA_UPLOADS = 6


class HostileTraffic:
    """Everything at once, for as long as it is let.

    Args:
        key: of the tenant ``who``.
        victims: tenants whose ids are tried.
        folder: for files that are built to harm.
        most: connections that one address may have.
        quota_volume: a volume as an .npy file, of which ``QUOTA_UPLOADS`` are more than the tenant may store.
    """

    def __init__(
        self,
        ledger: Ledger,
        url: str,
        who: str,
        key: str,
        victims: tuple[str, ...],
        folder: Path,
        ball: bytes,
        quota_volume: bytes,
        most: int,
    ) -> None:
        self._ledger = ledger
        self._url, self._who = url, who
        self._victims = victims
        self._ball, self._quota_volume = ball, quota_volume
        self._chance = random.Random(17)
        transport = httpx.HTTPTransport(local_address=FROM, limits=httpx.Limits(keepalive_expiry=2.0))
        own = {"Authorization": f"Bearer {key}"}
        self._http = httpx.Client(base_url=url, headers=own, transport=transport, timeout=PATIENCE_S)
        self._connections = HostileConnections(ledger, int(url.rpartition(":")[2]), key, most)
        write_dataset(folder / "sound.h5", small())
        self._scan = (folder / "sound.h5").read_bytes()
        self._files = itertools.cycle(_files(self._scan, folder))

    def actors(self) -> list[Callable[[float], None]]:
        """Attacks to run side by side, each until a time of the monotonic clock."""
        steps = (
            [self._connections.idle],
            [self._connections.slow_heads, self._connections.bodies_that_never_come],
            [self._connections.tiny_chunks, self._connections.forged, self._connections.no_http],
            [self._damaged_file],
            [self._expensive_pictures, self._left_alone, self._exports_by_head],
            [self._numbers_without_end, self._forged_keys, self._ids_of_others],
            [self._many_streams, self._abandoned_uploads],
            [self._deleted_under_readers, self._beyond_the_quota],
        )
        return [_repeating(own) for own in steps]

    def clean(self) -> None:
        """Delete all that the tenant has; jobs are cancelled first."""
        for job in self._ask("GET", "/v1/jobs").json()["jobs"]:
            if job["state"] in ("queued", "running"):
                self._ask("POST", f"/v1/jobs/{job['id']}/cancel")
        deadline = time.monotonic() + PATIENCE_S
        for listed in ("datasets", "volumes", "meshes"):
            for entry in self._ask("GET", f"/v1/{listed}").json()[listed]:
                while self._ask("DELETE", f"/v1/{listed}/{entry['id']}").status_code not in (204, 404):
                    assert time.monotonic() < deadline, f"{entry['id']} cannot be deleted"
                    time.sleep(0.5)

    def close(self) -> None:
        self._http.close()

    def _ask(self, method: str, path: str, **how: Any) -> httpx.Response:
        """Ask; when too many requests came, wait a while."""
        for _ in range(60):
            answer = self._http.request(method, path, **how)
            self._ledger.note(self._who, answer)
            if answer.status_code != 429:
                break
            time.sleep(min(float(answer.headers["retry-after"]), 2.0))
        return answer

    def _once(self, method: str, path: str, **how: Any) -> httpx.Response:
        answer = self._http.request(method, path, **how)
        self._ledger.note(self._who, answer)
        return answer

    def _damaged_file(self) -> None:
        what, content = next(self._files)
        answer = self._once("POST", f"/v1/{PLACES[what]}", content=content, headers=STREAM)
        if answer.status_code not in (408, 413, 415, 422, 429, 503, 507):
            self._ledger.fault(f"a damaged {what} was answered {answer.status_code}")

    def _expensive_pictures(self) -> None:
        volume = self._volume(self._ball)
        if volume is None:
            return

        def look(asked: str) -> None:
            with suppress(httpx.ReadTimeout):
                self._once("GET", f"/v1/volumes/{volume}/refraction.png?{asked}", timeout=MAX_WAIT_S)

        with ThreadPoolExecutor(6) as pool:
            list(pool.map(look, 2 * EXPENSIVE))
        self._ask("DELETE", f"/v1/volumes/{volume}")

    def _left_alone(self) -> None:
        volume = self._volume(self._ball)
        if volume is None:
            return
        for path in ("data?format=nifti", "data?format=mat", "slice.png", "refraction.png?iso=0.5", "data"):
            self._connections.gone(f"/v1/volumes/{volume}/{path}")
        with suppress(httpx.TimeoutException):
            self._once("POST", "/v1/datasets", content=self._scan, headers=STREAM, timeout=0.3)
        self._ask("DELETE", f"/v1/volumes/{volume}")

    def _exports_by_head(self) -> None:
        volume = self._volume(self._ball)
        if volume is None:
            return
        for form in ("nifti", "metaimage", "mat", "npy"):
            answer = self._once("HEAD", f"/v1/volumes/{volume}/data?format={form}")
            if answer.status_code == 200 and "content-length" in answer.headers:
                self._ledger.fault(f"HEAD made the export {form}")
        self._ask("DELETE", f"/v1/volumes/{volume}")

    def _numbers_without_end(self) -> None:
        content = (
            f'{{"kind": "simulation", "settings": {{"nodes": {HUGE}}}}}',
            f'{{"kind": "simulation", "settings": {{"noise_s": {HUGE}}}}}',
            f'{{"kind": "simulation", "settings": {{"nodes": 4096, "elements": 4096}}, "more": {HUGE}}}',
            "[" * 20_000,
        )
        for body in content:
            answer = self._once("POST", "/v1/jobs", content=body, headers=JSON)
            if answer.status_code not in (400, 413, 422, 429, 503):
                self._ledger.fault(f"{body[:80]} was answered {answer.status_code}")
        self._once("GET", f"/v1/datasets?limit={HUGE}")
        self._once("GET", "/v1/volumes/vol-00000000000000000000/slice.png?low=-1e308&high=1e308")

    def _forged_keys(self) -> None:
        for given in ("Bearer bentray_forged", "Basic YTpi", "Bearer", "Bearer " + 2000 * "x"):
            with httpx.Client(transport=_elsewhere(), timeout=PATIENCE_S) as http:
                answer = http.get(f"{self._url}/v1/volumes", headers={"Authorization": given})
            self._ledger.note("nobody", answer)
            if answer.status_code not in (401, 429, 503):
                self._ledger.fault(f"{given[:40]} was answered {answer.status_code}")

    def _ids_of_others(self) -> None:
        ids = [item for victim in self._victims for item in self._ledger.ids(victim)]
        for other_id in self._chance.sample(sorted(ids), min(8, len(ids))):
            kinds = {"ds": "datasets", "vol": "volumes", "mesh": "meshes", "job": "jobs", "up": "uploads"}
            path = f"/v1/{kinds[other_id.partition('-')[0]]}/{other_id}"
            further = {"volumes": "/data", "datasets": "/file", "jobs": "/events"}
            asked = [("GET", path, {}), ("GET", path + further.get(path.split("/")[2], ""), {})]
            if "jobs" in path:
                asked.append(("POST", path + "/cancel", {}))
            else:
                asked.append(("DELETE", path, TUS))
            for method, where, headers in asked:
                answer = self._once(method, where, headers=headers)
                if answer.status_code not in (404, 429, 503):
                    self._ledger.fault(f"{method} {where} of another got {answer.status_code}")

    def _many_streams(self) -> None:
        dataset = self._ask("POST", "/v1/datasets", content=self._scan, headers=STREAM)
        if dataset.status_code != 201:
            return
        # A job that is deleted with its dataset.
        settings = {"nodes": 32, "method": "sart", "iterations": 500, "attenuation": {"enabled": False}}
        asked = {"kind": "reconstruction", "dataset": dataset.json()["id"], "settings": settings}
        answer = self._ask("POST", "/v1/jobs", json=asked)
        if answer.status_code != 202:
            return
        job = answer.json()["id"]

        def watch(_: int) -> int:
            try:
                with self._http.stream("GET", f"/v1/jobs/{job}/events", timeout=1.0) as stream:
                    self._ledger.count(self._who, "GET /v1/jobs/*/events", stream.status_code)
                    for _ in stream.iter_lines():
                        pass
                    return stream.status_code
            except httpx.TransportError:
                return 0

        with ThreadPoolExecutor(70) as pool:
            list(pool.map(watch, range(140)))
        self._ask("POST", f"/v1/jobs/{job}/cancel")

    def _abandoned_uploads(self) -> None:
        for length in (1000, 10**6, HUGE):
            headers = {**TUS, "Upload-Length": str(length)}
            answer = self._once("POST", "/v1/uploads", headers=headers)
            if answer.status_code == 201:
                piece = {**PIECE, "Upload-Offset": "0"}
                self._once("PATCH", answer.headers["location"], headers=piece, content=bytes(500))

    def _deleted_under_readers(self) -> None:
        volume = self._volume(self._ball)
        if volume is None:
            return

        def read(path: str) -> None:
            answer = self._once("GET", f"/v1/volumes/{volume}/{path}")
            # An export counts against the quota, which other attacks of this tenant may have used up.
            if answer.status_code not in (200, 404, 429, 503, 507):
                self._ledger.fault(f"{path} of what is being deleted was answered {answer.status_code}")

        with ThreadPoolExecutor(9) as pool:
            reads = [
                pool.submit(read, path)
                for path in 2 * ("data", "data?format=npy", "slice.png", "slice.png?axis=x")
            ]
            time.sleep(self._chance.uniform(0.0, 0.3))
            gone = pool.submit(self._ask, "DELETE", f"/v1/volumes/{volume}").result()
            for item in reads:
                item.result()
        if gone.status_code not in (204, 503):
            self._ledger.fault(f"DELETE beside readers was answered {gone.status_code}")

    def _beyond_the_quota(self) -> None:
        def send(_: int) -> str | None:
            return self._volume(self._quota_volume)

        with ThreadPoolExecutor(QUOTA_UPLOADS) as pool:
            made = [upload for upload in pool.map(send, range(QUOTA_UPLOADS)) if upload is not None]
        for upload in made:
            self._ask("DELETE", f"/v1/volumes/{upload}")

    def _volume(self, content: bytes) -> str | None:
        """Upload a volume; its id, or nothing where it is refused."""
        answer = self._once("POST", "/v1/volumes?spacing_m=0.001", content=content, headers=STREAM)
        if answer.status_code not in (201, 429, 503, 507):
            self._ledger.fault(f"a volume was answered {answer.status_code} {answer.text[:300]}")
        return str(answer.json()["id"]) if answer.status_code == 201 else None


def _elsewhere() -> httpx.HTTPTransport:
    return httpx.HTTPTransport(local_address=FROM)


def _repeating(steps: list[Callable[[], None]]) -> Callable[[float], None]:
    def repeat(until: float) -> None:
        for step in itertools.cycle(steps):
            if time.monotonic() >= until:
                return
            # A connection that is closed on a hostile caller is no fault.
            with suppress(httpx.TransportError, OSError):
                step()
            time.sleep(0.2)

    return repeat


def _files(sound: bytes, folder: Path) -> Iterator[tuple[str, bytes]]:
    """Damaged files of every format, one of each kind after the other, without end."""
    scans = [path.read_bytes() for path in hostile_datasets.files(sound, folder, SCANS).values()]
    kinds = [
        [("dataset", content) for content in scans],
        [("volume", content) for content, given, _ in hostile_volumes.REFUSED.values() if not given],
        [("mesh", content) for content, _ in hostile_meshes.REFUSED.values()],
        [(what, content) for what, content, _, _ in hostile_variants.REFUSED.values()],
    ]
    mixed = [attack for several in itertools.zip_longest(*kinds) for attack in several if attack is not None]
    random.Random(3).shuffle(mixed)
    return iter(mixed)


def cube(side: int) -> bytes:
    """A volume of noise, which does not pack, as an .npy file."""
    return hostile_volumes.npy(np.random.default_rng(0).random((side, side, side), np.float32))

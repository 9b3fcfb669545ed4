"""A tenant who uses the service normally and checks every answer."""

import base64
import hashlib
import io
import json
import time
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from bentray_workers.files.reconstruction import read_reconstruction

from ..service.tus_records import PIECE, TUS
from .ledger import LATER, Ledger
from .machine import PATIENCE_S

STREAM = {"Content-Type": "application/octet-stream"}
# How often a request is sent again that was to come later.
TRIES = 60
PLAN = {"nodes": 32, "method": "sart", "iterations": 3, "attenuation": {"enabled": False}}
SIMULATION = {"nodes": 24, "elements": 16}
# Shorter than a service keeps a connection on which nothing is asked.
KEEPALIVE_S = 2.0


class HonestTenant:
    """Works through rounds, each of which must give the same bytes as the first.

    Args:
        name, key: of the tenant.
        scan: the file that is uploaded; ball: a volume as an .npy file.
        folder: for what is downloaded.
        speed: what the reconstruction of the scan gives, m/s.

    Attributes:
        rounds: that are done.
        waits_s: how long it was told to wait, in all, s.
    """

    def __init__(
        self,
        ledger: Ledger,
        url: str,
        name: str,
        key: str,
        scan: Path,
        ball: bytes,
        folder: Path,
        speed: np.ndarray,
    ) -> None:
        self._ledger = ledger
        self._name = name
        self._scan, self._ball = scan.read_bytes(), ball
        self._download = folder / f"{name}.h5"
        self._speed = speed
        self._http = httpx.Client(
            base_url=url,
            headers={"Authorization": f"Bearer {key}"},
            timeout=PATIENCE_S,
            limits=httpx.Limits(keepalive_expiry=KEEPALIVE_S),
        )
        self._first: dict[str, str] = {}
        self.rounds = 0
        self.waits_s = 0.0

    def work(self, until: float) -> None:
        """Do whole rounds until then, by the monotonic clock."""
        while time.monotonic() < until:
            self.round()

    def round(self) -> None:
        """One of everything, which is deleted at the end."""
        number, self.rounds = self.rounds, self.rounds + 1
        dataset = self._tus_upload() if number % 2 else self._direct_upload()
        assert self._get(f"/v1/datasets/{dataset}").json()["sha256"] == hashlib.sha256(self._scan).hexdigest()
        self._reconstruct(dataset, number)
        self._delete("datasets", dataset)
        self._look_at_a_volume()
        if number % 3 == 0:
            job = self._submit({"kind": "simulation", "settings": SIMULATION}, f"simulation {number}")
            made = self._ended(job)["dataset"]
            self._same("simulated", self._get(f"/v1/datasets/{made}/file").content)
            self._delete("datasets", made)
        for listed in ("datasets", "volumes", "meshes", "jobs"):
            assert self._get(f"/v1/{listed}").json()[listed] == []

    def close(self) -> None:
        self._http.close()

    def _reconstruct(self, dataset: str, number: int) -> None:
        asked = {"kind": "reconstruction", "dataset": dataset, "settings": PLAN}
        job = self._submit(asked, f"reconstruction {number}")
        assert self._submit(asked, f"reconstruction {number}") == job
        events = self._ask("GET", f"/v1/jobs/{job}/events", 200).text
        states = [line for line in events.splitlines() if line.startswith("data: ") and '"state"' in line]
        assert [json.loads(line[6:])["state"] for line in states][-2:] == ["running", "succeeded"], events
        volume = f"/v1/volumes/{self._ended(job)['volume']}"
        self._download.write_bytes(self._get(f"{volume}/data").content)
        assert np.array_equal(read_reconstruction(self._download).speed, self._speed)
        self._ask("HEAD", f"{volume}/data?format=npy", 200)
        values = self._get(f"{volume}/data?format=npy").content
        assert np.array_equal(np.load(io.BytesIO(values)), self._speed)
        part = self._ask("GET", f"{volume}/data?format=npy", 206, headers={"Range": "bytes=100-299"})
        assert part.content == values[100:300]
        for form in ("nifti", "metaimage"):
            self._same(form, self._get(f"{volume}/data?format={form}").content)
        self._same("slice", self._get(f"{volume}/slice.png?size=256").content)
        self._delete("volumes", volume.rpartition("/")[2])

    def _look_at_a_volume(self) -> None:
        answer = self._ask("POST", "/v1/volumes?spacing_m=0.001", 201, content=self._ball, headers=STREAM)
        volume = answer.json()["id"]
        seen = self._get(f"/v1/volumes/{volume}/refraction.png?width=48&height=32&iso=0.5")
        self._same("refraction", seen.content)
        self._same("axial slice", self._get(f"/v1/volumes/{volume}/slice.png?axis=z&index=6").content)
        mesh = self._ask("POST", f"/v1/volumes/{volume}/mesh?iso=0.5", 201).json()
        self._same("mesh", repr((mesh["vertices"], mesh["faces"])).encode())
        self._delete("meshes", mesh["id"])
        self._delete("volumes", volume)

    def _direct_upload(self) -> str:
        return str(self._ask("POST", "/v1/datasets", 201, content=self._scan, headers=STREAM).json()["id"])

    def _tus_upload(self) -> str:
        headers = {**TUS, "Upload-Length": str(len(self._scan))}
        place = self._ask("POST", "/v1/uploads", 201, headers=headers).headers["location"]
        half = len(self._scan) // 2
        for start, piece in ((0, self._scan[:half]), (half, self._scan[half:])):
            digest = base64.b64encode(hashlib.sha256(piece).digest()).decode()
            headers = {**PIECE, "Upload-Offset": str(start), "Upload-Checksum": f"sha256 {digest}"}
            self._ask("PATCH", place, 204, headers=headers, content=piece)
        deadline = time.monotonic() + PATIENCE_S
        while (record := self._get(place).json())["state"] != "done":
            assert record["state"] == "reading", record
            assert time.monotonic() < deadline, record
            time.sleep(0.2)
        return str(record["result"])

    def _submit(self, asked: dict[str, Any], key: str) -> str:
        headers = {"Idempotency-Key": f"{self._name} {key}"}
        return str(self._ask("POST", "/v1/jobs", 202, json=asked, headers=headers).json()["id"])

    def _ended(self, job: str) -> dict[str, Any]:
        deadline = time.monotonic() + PATIENCE_S
        while True:
            record: dict[str, Any] = self._get(f"/v1/jobs/{job}").json()
            assert record["state"] in ("queued", "running", "succeeded"), record
            if record["state"] == "succeeded":
                return record
            assert time.monotonic() < deadline, record
            time.sleep(0.2)

    def _delete(self, listed: str, name: str) -> None:
        self._ask("DELETE", f"/v1/{listed}/{name}", 204)
        self._ask("GET", f"/v1/{listed}/{name}", 404)

    def _same(self, what: str, content: bytes) -> None:
        """Check that equal inputs give equal results, whatever else goes on."""
        digest = hashlib.sha256(content).hexdigest()
        assert self._first.setdefault(what, digest) == digest, f"{what} differs from that of the first round"

    def _get(self, path: str) -> httpx.Response:
        return self._ask("GET", path, 200)

    def _ask(self, method: str, path: str, expected: int, **how: Any) -> httpx.Response:
        """Ask, and again as long as the answer says to come later."""
        for _ in range(TRIES):
            answer = self._http.request(method, path, **how)
            self._ledger.note(self._name, answer)
            if answer.status_code not in LATER:
                break
            wait_s = float(answer.headers["retry-after"])
            self.waits_s += wait_s
            time.sleep(wait_s)
        assert answer.status_code == expected, f"{method} {path}: {answer.status_code} {answer.text[:500]}"
        return answer

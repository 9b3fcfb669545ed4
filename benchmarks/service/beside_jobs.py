"""What a person waits for at the page beside *Best* and a geometry field on two workers, and without them."""

import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import repeat
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from bentray_kernels.meshes.example_surfaces import torus
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

from ..shared._synthetic_scan import made_up_bursts, made_up_scan
from ._http_load import beside, served
from ._short_jobs import ENDED
from .orbit import PREVIEW, VOLUMES, Shown, mesh_file, stored, stored_volume

SETTINGS = {"BENTRAY_WORKERS": "2", "BENTRAY_REQUESTS_PER_MINUTE": "0"}
# A scan of 128 x 256 traces, and faces along and around the mesh of a field that takes minutes.
SCAN, QUICK_SCAN = (128, 256), (32, 64)
FACES = (160, 80)
VOLUME_NODES = 96
BEST = {"method": "waveform", "minutes": 30}
# 7 s of two idle cores.
SHORT = {"method": "gauss-newton", "rays": "curved", "nodes": 128, "iterations": 12}
REQUESTS, QUICK_REQUESTS = 50, 4
JOBS, QUICK_JOBS = 5, 1
# Until both long jobs have tasks on the workers, and the pause of a person between two requests.
SETTLE_S, PAUSE_S = 20.0, 0.2
DRAG_S = 5.0
PATIENCE_S = 300.0


@dataclass(frozen=True)
class Action:
    """What a person does at the page.

    Attributes:
        name: for labels.
        goal_s: for its 95th percentile.
        act: does it once, by its number.
    """

    name: str
    goal_s: float
    act: Callable[[int], object]


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Each action alone and beside the two jobs, with the load at its end."""
    with (
        served(SETTINGS) as (url, folder),
        httpx.Client(base_url=url, timeout=PATIENCE_S, trust_env=False) as http,
    ):
        context.progress(0, 3, "uploads")
        page = _Page(http, folder, context.quick)
        # Kernels that no worker compiles at its start are not what this measures.
        for action in page.actions():
            action.act(-1)
        context.progress(1, 3, "without jobs")
        yield from page.measured("alone", 0, context.quick)
        context.progress(2, 3, "beside two jobs")
        with page.long_jobs():
            yield from page.measured("beside two jobs", REQUESTS, context.quick)


class _Page:
    """The requests of the page about a scan, a result, a volume and a mesh, all of one tenant."""

    def __init__(self, http: httpx.Client, folder: Path, quick: bool) -> None:
        self._http = http
        self._scan = self._uploaded(made_up_bursts(folder / "traces.h5", *(QUICK_SCAN if quick else SCAN)))
        self._times = self._uploaded(made_up_scan(folder / "times.h5", 128, 1))
        self._volume = stored_volume(http, VOLUME_NODES)["id"]
        self._mesh = stored(http, "/v1/meshes", mesh_file(torus(*FACES)))["id"]
        self._result = self._done({"method": "sart", "nodes": 96, "iterations": 1})["volume"]

    def actions(self) -> list[Action]:
        """Views differ by their number, so that none is drawn before."""
        scan, volume = f"/v1/datasets/{self._scan}", f"/v1/volumes/{self._volume}"
        picture = f"{volume}/refraction.png"
        plan = {"kind": "reconstruction", "dataset": self._scan, "settings": BEST}
        return [
            Action("quality report", 0.5, lambda k: self._got(f"{scan}/quality")),
            Action(
                "traces of an emission", 0.5, lambda k: self._got(f"{scan}/traces", emission=(7 * k) % 32)
            ),
            Action("slice", 1.0, lambda k: self._got(f"/v1/volumes/{self._result}/slice.png", low=1300 + k)),
            # Another smoothing is another filter and another scene, as of a volume that was never drawn.
            Action(
                "first glass picture", 1.5, lambda k: self._got(picture, smoothing=1.0 + 0.01 * k, **GLASS)
            ),
            Action("first clay picture", 1.5, lambda k: self._got(picture, smoothing=2.0 + 0.01 * k, **CLAY)),
            Action("plan", 1.0, lambda k: self._http.post("/v1/plans", json=plan).raise_for_status()),
        ]

    def measured(self, when: str, first: int, quick: bool) -> Iterator[Row]:
        """Rows of all actions from a first number, of dragging and of a short job."""
        requests = QUICK_REQUESTS if quick else REQUESTS
        for action in self.actions():
            taken = [_seconds(action.act, first + k) for k in range(requests)]
            words = f"median {np.median(taken):.2f} s, longest {max(taken):.2f} s of {len(taken)}"
            p95 = float(np.percentile(taken, 95))
            yield Row(f"{action.name} {when}, p95", p95, action.goal_s, "<=", "s", _loaded(words))
        for name, shown in zip(("clay", "glass"), VOLUMES, strict=True):
            yield Row(f"dragging {name} {when}", self._dragged(shown), 8.0, ">=", "1/s", _loaded("256²"))
        taken = [_seconds(lambda _: self._done(SHORT), k) for k in range(QUICK_JOBS if quick else JOBS)]
        words = f"median {np.median(taken):.1f} s of {len(taken)}, from submission to end"
        yield Row(f"short job {when}, longest", max(taken), 15.0, "<=", "s", _loaded(words))

    @contextmanager
    def long_jobs(self) -> Iterator[None]:
        """*Best* and a geometry field within the block; one that ends is followed by another."""
        best = {"kind": "reconstruction", "dataset": self._scan, "settings": BEST}
        # Another size of the image is another field.
        fields = (
            {"kind": "geometry-field", "mesh": self._mesh, "settings": {"image_size": size}}
            for size in range(513, 33, -1)
        )
        with beside([partial(self._run, jobs) for jobs in (repeat(best), fields)]) as threads:
            time.sleep(SETTLE_S)
            yield
            assert all(thread.is_alive() for thread in threads), "a long job failed"

    def _run(self, requests: Iterator[dict[str, Any]], leave: threading.Event) -> None:
        """Jobs one after the other, until one fails."""
        for request in requests:
            job = self._started(request)
            while (state := self._state(job)) not in ENDED:
                if leave.wait(0.5):
                    self._http.post(f"/v1/jobs/{job}/cancel")
                    return
            assert state == "succeeded", state

    def _state(self, job: str) -> str:
        return str(self._got(f"/v1/jobs/{job}").json()["state"])

    def _dragged(self, shown: Shown) -> float:
        """Previews of the page a second, each of another view, one request at a time."""
        begun, number = time.perf_counter(), 0
        while (lasted := time.perf_counter() - begun) < DRAG_S:
            number += 1
            view = {**shown.view, **shown.preview, **PREVIEW, "azimuth_deg": 0.7 * number}
            self._got(f"/v1/volumes/{self._volume}/refraction.png", **view)
        return number / lasted

    def _uploaded(self, path: Path) -> str:
        return str(stored(self._http, "/v1/datasets", path.read_bytes())["id"])

    def _got(self, path: str, **query: Any) -> httpx.Response:
        return self._http.get(path, params=query).raise_for_status()

    def _started(self, request: dict[str, Any]) -> str:
        return str(self._http.post("/v1/jobs", json=request).raise_for_status().json()["id"])

    def _done(self, settings: dict[str, Any]) -> dict[str, Any]:
        """The record of a finished reconstruction of travel times."""
        name = self._started({"kind": "reconstruction", "dataset": self._times, "settings": settings})
        begun = time.perf_counter()
        while self._state(name) not in ENDED:
            assert time.perf_counter() - begun < PATIENCE_S, name
            time.sleep(0.1)
        record: dict[str, Any] = self._got(f"/v1/jobs/{name}").json()
        assert record["state"] == "succeeded", record
        return record


GLASS = {"mode": "refract", "index": 1.2, "width": 512, "height": 512}
CLAY = {"mode": "shaded", "width": 512, "height": 512}


def _seconds(act: Callable[[int], object], number: int) -> float:
    time.sleep(PAUSE_S)
    begun = time.perf_counter()
    act(number)
    return time.perf_counter() - begun


def _loaded(words: str) -> str:
    return f"{words}; two workers, one tenant; load {os.getloadavg()[0]:.1f} then"

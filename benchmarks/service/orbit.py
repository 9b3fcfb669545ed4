"""Turning volumes and surface scenes: previews a second by requests and in the page, and pictures at rest."""

import io
import os
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlencode

import httpx
import numpy as np
import psutil
import trimesh

from bentray_kernels.meshes.example_surfaces import torus
from bentray_kernels.meshes.mesh import TriangleMesh
from bentray_kernels.phantoms import TWO_HOLES, sampled
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.exit_codes import WorkFailed

from . import _orbit_page
from ._http_load import served

NODES, QUICK_NODES = 192, 64
# Faces along and around a ring.
RING, QUICK_RING = (96, 48), (24, 16)
# Of its geometry field; the defaults unless quick.
QUICK_FIELD = {"samples": 8, "inner_samples": 4, "divisions": 4, "image_size": 33}
SECONDS, QUICK_SECONDS = 5.0, 2.0
RESTS, QUICK_RESTS = 5, 2
# Motions in the page, and the time of each.
MOTIONS, MOTION_S = 4, 2.0
FIELD_S = 1800.0
# As in pages/rendering.js and pages/surfaces.js.
PREVIEW = {"width": 256, "height": 256}
FULL = {"width": 512, "height": 512}
VOLUME = {"index": 1.2}

Query = dict[str, str | int | float]


@dataclass(frozen=True)
class Shown:
    """A mode of the viewer.

    Attributes:
        name: for labels.
        view: parameters of previews and full pictures, and of the page.
        preview, full: what is added to previews and to full pictures.
    """

    name: str
    view: Query
    preview: Query = field(default_factory=dict)
    full: Query = field(default_factory=dict)


VOLUMES = (
    Shown(
        "lit surface",
        {"mode": "shaded"},
        {"supersampling": "none"},
        {"supersampling": "real", "degree": 2},
    ),
    Shown(
        "glass",
        {"mode": "refract"},
        {**VOLUME, "supersampling": "none", "ray_spacing": 2},
        {**VOLUME, "supersampling": "prss"},
    ),
)
SURFACES = (
    Shown("mirror of a mesh", {"mode": "self"}, {}, {"rays": 2}),
    Shown("glass of a mesh", {"mode": "refract"}, {}, {"rays": 2}),
    Shown("two mirrors and a ball", {"mode": "self", "scene": "mirror-ball"}, {}, {"rays": 2}),
)


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Two rows for each mode by requests, and two in the page, with the load that they began under."""
    detail = f"load average {os.getloadavg()[0]:.1f}"
    steps = 2 * (len(VOLUMES) + len(SURFACES))
    done = 0

    def step(name: str) -> None:
        nonlocal done
        context.progress(done, steps, name)
        done += 1

    with served() as (url, _), httpx.Client(base_url=url, timeout=120.0, trust_env=False) as http:
        volume = stored_volume(http, QUICK_NODES if context.quick else NODES)
        mesh, picture = stored_field(http, context.quick)
        sets = (
            (VOLUMES, str(volume["links"]["refraction"]), f"{url}/#/rendering/{volume['id']}?view=surface"),
            (SURFACES, picture, f"{url}/#/surfaces/{mesh}"),
        )
        for modes, address, _ in sets:
            for mode in modes:
                step(mode.name)
                yield from turned(http, address, mode, context.quick, detail)
        for modes, _, page in sets:
            for mode in modes:
                step(f"{mode.name} in the page")
                yield from turned_in_page(page, mode, context.quick, detail)


def stored_volume(http: httpx.Client, nodes: int) -> dict[str, Any]:
    """Upload a volume of 8-bit integers; returns its record."""
    content = io.BytesIO()
    np.save(content, np.round(255.0 * sampled(TWO_HOLES, nodes)).astype(np.uint8))
    return stored(http, "/v1/volumes", content.getvalue())


def stored_field(http: httpx.Client, quick: bool) -> tuple[str, str]:
    """Upload a ring and build its geometry field; returns the mesh and the address of its pictures.

    Raises:
        WorkFailed: if it is not built.
    """
    mesh = str(stored(http, "/v1/meshes", mesh_file(torus(*(QUICK_RING if quick else RING))))["id"])
    asked = {"kind": "geometry-field", "mesh": mesh, "settings": QUICK_FIELD if quick else {}}
    job = http.post("/v1/jobs", json=asked).raise_for_status().json()
    until = time.monotonic() + FIELD_S
    while job["state"] in ("queued", "running"):
        if time.monotonic() > until:
            raise WorkFailed(f"the geometry field was not built within {FIELD_S:g} s")
        time.sleep(0.5)
        job = http.get(f"/v1/jobs/{job['id']}").raise_for_status().json()
    if job["state"] != "succeeded":
        raise WorkFailed(f"the geometry field was not built: {job['error']}")
    return mesh, str(job["links"]["image"])


def mesh_file(mesh: TriangleMesh) -> bytes:
    """A mesh as PLY."""
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(file_type="ply")


def processor_s() -> dict[str, float]:
    """Processor time of the processes below this one so far, s: of the service with workers, the browser."""
    spent = {"service": 0.0, "browser": 0.0}
    for process in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):
            times = process.cpu_times()
            spent["service" if "python" in process.name() else "browser"] += times.user + times.system
    return spent


def shares(before: dict[str, float], frames: int) -> str:
    """Processor time a frame since ``before``, in words."""
    taken = {name: 1e3 * (now - before[name]) / max(1, frames) for name, now in processor_s().items()}
    return "processor time a frame " + ", ".join(
        f"{name} {ms:.0f} ms" for name, ms in taken.items() if ms >= 0.5
    )


def stored(http: httpx.Client, address: str, content: bytes) -> dict[str, Any]:
    headers = {"Content-Type": "application/octet-stream"}
    record: dict[str, Any] = http.post(address, content=content, headers=headers).raise_for_status().json()
    return record


def turned(http: httpx.Client, picture: str, mode: Shown, quick: bool, detail: str) -> Iterator[Row]:
    """Previews one after the other, each of another view, then full pictures."""

    def seconds(view: Query, azimuth_deg: float) -> float:
        begun = time.perf_counter()
        query = urlencode({**mode.view, **view, "azimuth_deg": azimuth_deg})
        http.get(f"{picture}?{query}").raise_for_status()
        return time.perf_counter() - begun

    # The scene is built, and kernels are compiled, for the first pictures.
    built = seconds({**mode.preview, **PREVIEW}, -1.0)
    seconds({**mode.full, **FULL}, -1.0)
    taken: list[float] = []
    before = processor_s()
    while sum(taken) < (QUICK_SECONDS if quick else SECONDS):
        taken.append(seconds({**mode.preview, **PREVIEW}, 0.7 * len(taken)))
    p50, p95 = 1e3 * np.percentile(taken, [50, 95])
    rate = f"p50 {p50:.0f} ms, p95 {p95:.0f} ms, one request at a time; first picture {built:.1f} s"
    rate += f"; {shares(before, len(taken))}; {detail}"
    yield Row(f"orbit, {mode.name} at 256²", len(taken) / sum(taken), 10.0, ">=", "1/s", rate)
    full = [seconds({**mode.full, **FULL}, 0.3 + 40.0 * k) for k in range(QUICK_RESTS if quick else RESTS)]
    words = f"median of {len(full)} pictures of 512², longest {max(full):.2f} s; {detail}"
    yield Row(f"orbit, {mode.name}: full quality at rest", float(np.median(full)), 1.0, "<", "s", words)


def turned_in_page(page: str, mode: Shown, quick: bool, detail: str) -> Iterator[Row]:
    """Turn the object in Chromium, where it is installed."""
    labels = (
        (f"orbit in the page, {mode.name} at 256²", 10.0, ">=", "1/s"),
        (f"orbit in the page, {mode.name}: full quality at rest", 1.0, "<", "s"),
    )
    if reason := _orbit_page.missing():
        yield from (Row(label, None, goal, op, unit, reason) for label, goal, op, unit in labels)
        return
    motions = QUICK_RESTS if quick else MOTIONS
    with _orbit_page.opened() as tab:
        before = processor_s()
        seen = _orbit_page.turn(tab, f"{page}?{urlencode(mode.view)}", MOTION_S, motions)
        spent = shares(before, seen.previews)
    detail = f"headless Chromium on the same machine; {detail}"
    moving = f"{motions} motions of {MOTION_S:g} s, {spent} with the pictures at rest"
    yield Row(labels[0][0], seen.rate, *labels[0][1:], f"{moving}; {detail}")
    words = f"median of {motions}, longest {max(seen.rests_s):.2f} s; after the last movement; {detail}"
    yield Row(labels[1][0], float(np.median(seen.rests_s)), *labels[1][1:], words)

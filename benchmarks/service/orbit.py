"""Turning a volume as the viewer does: previews a second over loopback, and the full picture at rest."""

from __future__ import annotations

import io
import os
import tempfile
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlencode

import httpx
import numpy as np

from bentray_kernels.phantoms import TWO_HOLES, sampled
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.service_process import running_service

NODES, QUICK_NODES = 192, 64
SECONDS, QUICK_SECONDS = 20.0, 4.0
RESTS, QUICK_RESTS = 8, 2
# As in pages/rendering.js.
PREVIEW = {"width": 256, "height": 256, "supersampling": "none"}
FULL = {"width": 512, "height": 512}


@dataclass(frozen=True)
class Shown:
    """A mode of the viewer: what it adds to previews and to full pictures."""

    name: str
    preview: dict[str, str | int]
    full: dict[str, str | int]


MODES = (
    Shown(
        "lit surface",
        {**PREVIEW, "mode": "shaded"},
        {**FULL, "mode": "shaded", "supersampling": "real", "degree": 2},
    ),
    Shown("glass", {**PREVIEW, "ray_spacing": 2}, {**FULL, "supersampling": "prss"}),
)


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Two rows for each mode, with the load that they began under."""
    busy = os.getloadavg()[0]
    nodes = QUICK_NODES if context.quick else NODES
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with (
            running_service(folder / "data", folder / "log") as url,
            httpx.Client(base_url=url, timeout=120.0) as http,
        ):
            picture = stored(http, nodes)
            for number, mode in enumerate(MODES):
                context.progress(number, len(MODES), mode.name)
                yield from turned(
                    http, picture, mode, context.quick, f"8-bit volume of {nodes}³; load average {busy:.1f}"
                )


def stored(http: httpx.Client, nodes: int) -> str:
    """Upload a volume of 8-bit integers; returns the address of its pictures."""
    content = io.BytesIO()
    np.save(content, np.round(255.0 * sampled(TWO_HOLES, nodes)).astype(np.uint8))
    sent = http.post(
        "/v1/volumes", content=content.getvalue(), headers={"Content-Type": "application/octet-stream"}
    )
    return str(sent.raise_for_status().json()["links"]["refraction"])


def turned(http: httpx.Client, picture: str, mode: Shown, quick: bool, detail: str) -> Iterator[Row]:
    """Previews one after the other, each of another view, then full pictures."""

    def seconds(view: dict[str, str | int], azimuth_deg: float) -> float:
        begun = time.perf_counter()
        http.get(
            f"{picture}?{urlencode({**view, 'index': 1.2, 'azimuth_deg': azimuth_deg})}"
        ).raise_for_status()
        return time.perf_counter() - begun

    # The scene is built for the first picture.
    built = seconds(mode.preview, -1.0)
    taken: list[float] = []
    while sum(taken) < (QUICK_SECONDS if quick else SECONDS):
        taken.append(seconds(mode.preview, 0.7 * len(taken)))
    p50, p95 = 1e3 * np.percentile(taken, [50, 95])
    rate = f"p50 {p50:.0f} ms, p95 {p95:.0f} ms, one request at a time; first picture {built:.1f} s; {detail}"
    yield Row(f"orbit, {mode.name} at 256²", len(taken) / sum(taken), 10.0, ">=", "1/s", rate)
    full = [seconds(mode.full, 0.3 + 40.0 * k) for k in range(QUICK_RESTS if quick else RESTS)]
    words = f"median of {len(full)} pictures of 512², longest {max(full):.2f} s; {detail}"
    yield Row(f"orbit, {mode.name}: full quality at rest", float(np.median(full)), 1.0, "<", "s", words)

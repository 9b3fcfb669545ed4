"""Duration of a short job beside long jobs of another tenant, from its submission to its end."""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from bentray_service.cli.output.benchmark_row import Row

from ..shared._synthetic_scan import made_up_scan

# Tenants are users of a proxy, as which every client of this machine counts.
SETTINGS = {
    "BENTRAY_WORKERS": "2",
    "BENTRAY_TRUSTED_PROXIES": "127.0.0.1",
    "BENTRAY_REQUESTS_PER_MINUTE": "0",
}
HOSPITAL, LAB = "hospital", "lab"
# One emission of it takes half a minute of a core.
WAVES = {"waveform": True, "frequency_hz": 1e6, "side_m": 0.2, "elements": 128, "emissions": 64}
SHORT = {"nodes": 96, "iterations": 4, "method": "sart", "attenuation": {"enabled": False}}
ENDED = ("succeeded", "failed", "cancelled")
MANY = 20
GOAL_S = 8.0
POLL_S, PATIENCE_S, TIMEOUT_S = 0.05, 300.0, 60.0


def short_jobs(url: str, folder: Path, *, quick: bool) -> Iterator[Row]:
    """Alone, beside one long simulation, and beside twenty long jobs; by twos of workers and tenants."""
    tries, settle_s = (2, 5.0) if quick else (8, 20.0)
    asked = {"kind": "reconstruction", "settings": SHORT}
    asked["dataset"] = _upload(url, LAB, made_up_scan(folder / "short.h5", 64, 1))
    large = _upload(url, HOSPITAL, made_up_scan(folder / "large.h5", 256, 16))
    settings = {"nodes": 256, "method": "gauss-newton", "iterations": 200}
    simulation = {"kind": "simulation", "settings": WAVES}
    reconstruction = {"kind": "reconstruction", "dataset": large, "settings": settings}
    _seconds(url, asked)
    alone = [_seconds(url, asked) for _ in range(tries)]
    yield _row("alone", alone, GOAL_S, os.getloadavg()[0])
    several = [simulation if k % 2 else reconstruction for k in range(MANY)]
    for name, long_jobs in (("one long simulation", [simulation]), (f"{MANY} long jobs", several)):
        with _running(url, long_jobs):
            # Until each worker has a long task.
            time.sleep(settle_s)
            seconds = []
            for k in range(tries):
                # At another moment of the long tasks each time.
                time.sleep(0.7 * k)
                seconds.append(_seconds(url, asked))
            yield _row(f"beside {name}", seconds, GOAL_S, os.getloadavg()[0])


def _row(name: str, seconds: list[float], goal_s: float, load: float) -> Row:
    half = float(np.median(seconds))
    detail = f"p50 {half:.2f} s, worst {max(seconds):.2f} s of {len(seconds)}; two workers, another tenant; "
    return Row(f"short job {name}, worst", max(seconds), goal_s, "<=", "s", f"{detail}load {load:.1f} then")


@contextmanager
def _running(url: str, asked: list[dict[str, Any]]) -> Iterator[None]:
    """Long jobs of the other tenant within the block."""
    jobs = [_asked(url, HOSPITAL, "POST", "/v1/jobs", request)["id"] for request in asked]
    try:
        yield
        states = [_asked(url, HOSPITAL, "GET", f"/v1/jobs/{job}")["state"] for job in jobs]
        assert not set(states) & set(ENDED), f"a long job was too short: {states}"
        assert "running" in states
    finally:
        for job in jobs:
            _asked(url, HOSPITAL, "POST", f"/v1/jobs/{job}/cancel")
        while any(_asked(url, HOSPITAL, "GET", f"/v1/jobs/{job}")["state"] not in ENDED for job in jobs):
            time.sleep(POLL_S)


def _seconds(url: str, asked: dict[str, Any]) -> float:
    """From the submission of a job of the small tenant to its end."""
    begun = time.perf_counter()
    job = _asked(url, LAB, "POST", "/v1/jobs", asked)["id"]
    while (state := _asked(url, LAB, "GET", f"/v1/jobs/{job}")["state"]) not in ENDED:
        assert time.perf_counter() - begun < PATIENCE_S, state
        time.sleep(POLL_S)
    assert state == "succeeded", state
    return time.perf_counter() - begun


def _upload(url: str, who: str, path: Path) -> str:
    headers = {"Content-Type": "application/x-hdf5"}
    return str(_sent(url, who, "POST", "/v1/datasets", content=path.read_bytes(), headers=headers)["id"])


def _asked(url: str, who: str, verb: str, path: str, body: dict[str, Any] | None = None) -> dict[str, Any]:
    return _sent(url, who, verb, path, json=body)


def _sent(
    url: str, who: str, verb: str, path: str, headers: dict[str, str] | None = None, **body: Any
) -> dict[str, Any]:
    named = {**(headers or {}), "X-Forwarded-User": who}
    answer = httpx.request(verb, url + path, headers=named, timeout=TIMEOUT_S, trust_env=False, **body)
    assert answer.is_success, (answer.status_code, answer.text[:300])
    record: dict[str, Any] = answer.json()
    return record

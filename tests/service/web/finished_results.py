"""Results with known values, as jobs of a service that a browser visits."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import h5py
import httpx
import numpy as np
import pytest
from numpy.typing import NDArray

from ..conftest import ENDED, PATIENCE_S, FakeWork
from .conftest import SharedService
from .live_results import started

SPACING_M, ORIGIN_M = (1e-3, 2e-3, 3e-3), (-0.01, -0.02, 0.005)


def known(shape: tuple[int, ...], seed: int = 0) -> NDArray[np.float64]:
    """Speeds of about 1500 m/s, each node another."""
    return 1500.0 + 30.0 * np.random.default_rng(seed).standard_normal(shape)


def finished(
    service: SharedService,
    speed: NDArray[np.float64],
    change: Callable[[h5py.File], None] | None = None,
    **images: Any,
) -> str:
    """The id of a job that made these images, or other fields of a result, of the scan after a change."""
    plain = FakeWork.__call__

    def made(self: FakeWork, *given: Any, **named: Any) -> Any:
        grid = {"spacing_m": SPACING_M[: speed.ndim], "origin_m": ORIGIN_M[: speed.ndim]}
        own: dict[str, Any] = {"coverage": np.ones(speed.shape), **images}
        if "uncertainty" in images:
            own["resolution_width_m"] = (0.0025,)
        return replace(plain(self, *given, **named), speed=speed, **own, **grid)

    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(FakeWork, "__call__", made)
        job = started(service.address, lambda: service.scan(change))
        deadline = time.monotonic() + PATIENCE_S
        while job["state"] not in ENDED and time.monotonic() < deadline:
            time.sleep(0.02)
            job = httpx.get(f"{service.address}{job['links']['self']}", timeout=60).json()
    assert job["state"] == "succeeded", job
    return str(job["id"])

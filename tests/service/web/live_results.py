"""A reconstruction of known images, each made when a test says so, as a job that a browser watches."""

import io
import queue
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from numpy.typing import ArrayLike

from bentray_kernels.task_graph import Cancelled
from bentray_kernels.tomography.reconstruction_graph import ReconstructionCheckpoint
from bentray_kernels.tomography.result import Iteration, Progress
from bentray_kernels.tomography.sart import sart_step
from bentray_service.jobs import kinds
from bentray_workers.cluster.checkpoints import Checkpoints
from bentray_workers.reconstruction import reconstruction_run

from ..conftest import FakeWork

# Of the image of each iteration.
CONTRASTS_MPS = (20.0, 40.0, 20.0, 30.0, 40.0, 50.0)
ITERATIONS = len(CONTRASTS_MPS)
# Nodes; their spacing and the position of the first one, m.
SHAPE, SPACING_M, ORIGIN_M = (48, 36), 1e-3, (-0.02, -0.01)
# A wrong value at one node of the third image, m/s.
SPIKE_MPS = 1700.0


def in_turns(
    work: FakeWork, monkeypatch: pytest.MonkeyPatch, band_hz: tuple[float, float] | None = None
) -> queue.Queue[None]:
    """A queue; for each of its items a reconstruction makes one iteration and saves its image."""
    waiting: queue.Queue[None] = queue.Queue()

    def reconstruct(
        client: Any,
        path: Path,
        settings: Any,
        on_progress: Any,
        stop: Any,
        work_dir: Path,
        on_saved: Any,
        share: Any,
    ) -> Any:
        kept, history = Checkpoints(work_dir / reconstruction_run.CHECKPOINTS), ()
        on_progress(Progress(0, 8 * ITERATIONS, (), "reconstructing"))
        for sweep in range(1, ITERATIONS + 1):
            while True:
                if stop():
                    raise Cancelled
                try:
                    waiting.get(timeout=0.05)
                    break
                except queue.Empty:
                    pass
            speed = 1500.0 + CONTRASTS_MPS[sweep - 1] * np.linspace(0.0, 1.0, np.prod(SHAPE)).reshape(SHAPE)
            if sweep == 3:
                speed[20, 15] = SPIKE_MPS
            state = replace(sart_step.begin(1.0 / speed), iteration=sweep)
            kept.save("0-00000", ReconstructionCheckpoint(0, 0, (), state, (), SPACING_M, ORIGIN_M))
            history += (Iteration(0, sweep, 2e-6 / sweep, 8, band_hz=band_hz),)
            on_progress(Progress(8 * sweep, 8 * ITERATIONS, history, "reconstructing"))
        return work(client, path, settings, on_progress, stop, work_dir, on_saved, share)

    monkeypatch.setattr(reconstruction_run, "reconstruct", reconstruct)
    return waiting


def simulating(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Let each simulation make a scan of the name "A phantom" at once; the requests for them."""
    requests: list[Any] = []
    made = {"title": "A phantom", "source": "", "license": "", "dimension": 2, "elements": 16, "ntx": 16}
    made |= {"nrx": 16, "slices": 1, "has_traces": False, "has_travel_times": True, "has_truth": True}
    made |= {"water_speed_mps": 1500.0, "bytes": 1, "sha256": "0" * 64}

    def simulate_scan(client: Any, request: Any, target: Path, work_dir: Path, **control: Any) -> Any:
        requests.append(request)
        target.write_bytes(b"scan")
        return made

    monkeypatch.setattr(kinds, "simulate_to_file", simulate_scan)
    return requests


def uploaded(address: str, file: Path) -> dict[str, Any]:
    """The record of a scan that has just been uploaded."""
    headers = {"Content-Type": "application/x-hdf5"}
    sent = httpx.post(f"{address}/v1/datasets", content=file.read_bytes(), headers=headers, timeout=60)
    return dict(sent.raise_for_status().json())


def stored_volume(address: str, values: ArrayLike, query: str = "") -> dict[str, Any]:
    """The record of a volume that has just been uploaded."""
    content = io.BytesIO()
    np.save(content, values)
    headers = {"Content-Type": "application/x-npy"}
    sent = httpx.post(f"{address}/v1/volumes{query}", content=content.getvalue(), headers=headers, timeout=60)
    return dict(sent.raise_for_status().json())


def started(address: str, scan: Callable[..., Path]) -> dict[str, Any]:
    """The record of a reconstruction of the scan that has just been submitted."""
    dataset = uploaded(address, scan())["id"]
    asked = {"kind": "reconstruction", "dataset": dataset, "settings": {"method": "sart", "nodes": 16}}
    return dict(httpx.post(f"{address}/v1/jobs", json=asked, timeout=60).json())

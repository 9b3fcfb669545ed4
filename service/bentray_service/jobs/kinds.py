"""The kinds of job: how each reads its settings and what it runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol

from pydantic import TypeAdapter

from bentray_kernels.tomography.result import Progress, Reconstruction
from bentray_kernels.tomography.settings import Settings
from bentray_workers import slices
from bentray_workers.reconstruction_file import write_reconstruction


@dataclass(frozen=True)
class Task:
    """One job, as its kind is given it.

    Attributes:
        client: the ``distributed.Client`` of the worker pool.
        dataset: the canonical dataset file.
        settings: as stored with the job.
        target: the volume file to write, atomically.
        work_dir: an empty folder for the time it runs, which every worker can read and write.
        on_progress: told how far it is; may be called often.
        stop: whether to give up, by raising ``slices.Cancelled``.
    """

    client: Any
    dataset: Path
    settings: dict[str, Any]
    target: Path
    work_dir: Path
    on_progress: Callable[[Progress], None]
    stop: Callable[[], bool]


class Kind(Protocol):
    """A kind of job."""

    def run(self, task: Task) -> dict[str, Any]:
        """Do the work, write ``task.target`` and return the columns of the volume row."""


class ReconstructionKind:
    """Speed of sound from one dataset."""

    settings: TypeAdapter[Settings] = TypeAdapter(Settings)

    def run(self, task: Task) -> dict[str, Any]:
        settings = self.settings.validate_python(task.settings)
        result = slices.reconstruct(
            task.client, task.dataset, settings, task.on_progress, task.stop, task.work_dir
        )
        write_reconstruction(task.target, result)
        return {**_describe(result), "bytes": task.target.stat().st_size}


KINDS: Mapping[str, Kind] = MappingProxyType({"reconstruction": ReconstructionKind()})


def _describe(result: Reconstruction) -> dict[str, Any]:
    return {
        "axes": ",".join("xyz"[: result.speed.ndim]),
        "shape": list(result.speed.shape),
        "spacing_m": [finite(value) for value in result.spacing_m],
        "origin_m": [finite(value) for value in result.origin_m],
        "speed_range_mps": [float(result.speed.min()), float(result.speed.max())],
        "water_speed_mps": float(result.water_speed_mps),
        "provenance": dict(result.provenance),
    }


def finite(value: float) -> float | None:
    """A number that JSON can hold: None for NaN and infinity."""
    return float(value) if math.isfinite(value) else None

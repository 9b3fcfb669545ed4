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
from bentray_workers.turntable import Turntable, turn

from ..storage.files import Files
from ..storage.ids import volume_of

Row = dict[str, Any]


@dataclass(frozen=True)
class Task:
    """One job, as its kind is given it.

    Attributes:
        client: the ``distributed.Client`` of the worker pool.
        source: the file that it reads, as ``Kind.source`` says.
        settings: as stored with the job.
        target: the file to write, atomically, as ``Kind.target`` says.
        work_dir: an empty folder for the time it runs, which every worker can read and write.
        on_progress: told how far it is; may be called often.
        stop: whether to give up, by raising ``slices.Cancelled``.
    """

    client: Any
    source: Path
    settings: dict[str, Any]
    target: Path
    work_dir: Path
    on_progress: Callable[[Progress], None]
    stop: Callable[[], bool]


class Kind(Protocol):
    """A kind of job."""

    def source(self, files: Files, job: Row) -> Path:
        """The file that the job reads."""

    def target(self, files: Files, job: Row) -> Path:
        """The file that it writes; fixed, so that a job which is run again writes the same one."""

    def run(self, task: Task) -> Row | None:
        """Do the work, write ``task.target``, and return the row of the volume that it is, if it is one."""


class ReconstructionKind:
    """Speed of sound from one dataset."""

    settings: TypeAdapter[Settings] = TypeAdapter(Settings)

    def source(self, files: Files, job: Row) -> Path:
        return files.dataset(job["dataset_id"])

    def target(self, files: Files, job: Row) -> Path:
        return files.volume(volume_of(job["id"]))

    def run(self, task: Task) -> Row | None:
        settings = self.settings.validate_python(task.settings)
        result = slices.reconstruct(
            task.client, task.source, settings, task.on_progress, task.stop, task.work_dir
        )
        write_reconstruction(task.target, result)
        return {"id": task.target.stem, **_describe(result), "bytes": task.target.stat().st_size}


class RefractionKind:
    """A turntable of one volume."""

    settings: TypeAdapter[Turntable] = TypeAdapter(Turntable)

    def source(self, files: Files, job: Row) -> Path:
        return files.volume(job["volume_id"])

    def target(self, files: Files, job: Row) -> Path:
        return files.animation(job["id"], job["settings"]["format"])

    def run(self, task: Task) -> Row | None:
        turntable = self.settings.validate_python(task.settings)
        turn(
            task.client,
            task.source,
            turntable,
            task.target,
            task.work_dir,
            task.on_progress,
            task.stop,
        )
        return None


KINDS: Mapping[str, Kind] = MappingProxyType(
    {"reconstruction": ReconstructionKind(), "refraction": RefractionKind()}
)


def _describe(result: Reconstruction) -> Row:
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

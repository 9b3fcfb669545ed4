"""The kinds of job: how each reads its settings and what it runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np
from pydantic import TypeAdapter

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography.model_selection.selection import told
from bentray_kernels.tomography.result import Progress, Reconstruction
from bentray_kernels.tomography.stored_settings import from_stored
from bentray_workers.cluster.fair_shares import Share
from bentray_workers.cluster.task_pool import ClusterTasks
from bentray_workers.files.reconstruction import write_reconstruction
from bentray_workers.reconstruction import reconstruction_run
from bentray_workers.rendering import geometry_field
from bentray_workers.rendering.field_settings import FieldSettings
from bentray_workers.rendering.turntable import PRIORITY, Turntable, turn
from bentray_workers.simulation.request import AskedSimulation
from bentray_workers.simulation.simulation_run import simulate_scan

from ..files.tenant_files import TenantFiles
from ..rows import schema
from ..rows.ids import dataset_of, volume_of

Row = dict[str, Any]


@dataclass(frozen=True)
class Task:
    """One job, as its kind is given it.

    Attributes:
        client: the ``distributed.Client`` of the worker pool.
        source: what it reads, as ``Kind.source`` says.
        settings: as stored with the job.
        target: the file to write, atomically, as ``Kind.target`` says.
        work_dir: a folder of its own, which every worker can read and write. What an unfinished run left in
            it is still there, and is gone on from.
        on_progress: told how far it is; may be called often.
        on_saved: told whenever it has kept something to go on from.
        stop: whether to give up, by raising ``slices.Cancelled``.
        share: of the workers; how many tasks the job may have in flight.
    """

    client: Any
    source: Path
    settings: dict[str, Any]
    target: Path
    work_dir: Path
    on_progress: Callable[[Progress], None]
    on_saved: Callable[[], None]
    stop: Callable[[], bool]
    share: Share


class Kind(Protocol):
    """A kind of job.

    Attributes:
        table: the name of that in which its results are.
        lane: what its tasks ask of a worker, a key of ``bentray_workers.cluster.resources.OFFERED``.
    """

    @property
    def table(self) -> str: ...

    @property
    def lane(self) -> str: ...

    def source(self, files: TenantFiles, job: Row) -> Path:
        """The file that the job reads; one that reads nothing has its own folder."""

    def target(self, files: TenantFiles, job: Row) -> Path:
        """The file that it writes; fixed, so that a job which is run again writes the same one."""

    def run(self, task: Task) -> Row | None:
        """Do the work, write ``task.target``, and return the row that tells of it, if there is one."""

    def discard(self, files: TenantFiles, target: Path) -> None:
        """Remove what was written, of a job that was cancelled at its very end."""


class ReconstructionKind:
    """Speed of sound from one dataset."""

    table, lane = schema.volumes.name, "recon"

    def source(self, files: TenantFiles, job: Row) -> Path:
        return files.dataset(job["dataset_id"])

    def target(self, files: TenantFiles, job: Row) -> Path:
        return files.volume(volume_of(job["id"]))

    def run(self, task: Task) -> Row | None:
        settings = from_stored(task.settings)
        progress = task.on_progress, task.stop, task.work_dir, task.on_saved
        result = reconstruction_run.reconstruct(
            task.client, task.source, settings, *progress, share=task.share
        )
        if not np.isfinite(result.speed).all():
            found = f"no finite speed at {np.count_nonzero(~np.isfinite(result.speed))} nodes"
            accepted = "settings by which it converges: a smaller relaxation or a larger penalty_strength"
            raise InvalidInput("settings", found, accepted)
        write_reconstruction(task.target, result)
        return {"id": task.target.stem, **_describe(result), "bytes": task.target.stat().st_size}

    def discard(self, files: TenantFiles, target: Path) -> None:
        files.drop(target)


class SimulationKind:
    """The scan of a phantom, as a dataset."""

    table, lane = schema.datasets.name, "recon"
    settings: TypeAdapter[AskedSimulation] = TypeAdapter(AskedSimulation)

    def source(self, files: TenantFiles, job: Row) -> Path:
        return files.work(job["id"])

    def target(self, files: TenantFiles, job: Row) -> Path:
        return files.dataset(dataset_of(job["id"]))

    def run(self, task: Task) -> Row | None:
        asked = self.settings.validate_python(task.settings)
        progress = task.on_progress, task.on_saved, task.stop, task.share
        found = simulate_scan(task.client, asked, task.target, task.work_dir, *progress)
        return {"id": task.target.stem, **found}

    def discard(self, files: TenantFiles, target: Path) -> None:
        files.drop(target)


class RefractionKind:
    """A turntable of one volume; it has no row but the job's."""

    table, lane = schema.volumes.name, "render"
    settings: TypeAdapter[Turntable] = TypeAdapter(Turntable)

    def source(self, files: TenantFiles, job: Row) -> Path:
        return files.volume(job["volume_id"])

    def target(self, files: TenantFiles, job: Row) -> Path:
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
            task.on_saved,
            task.stop,
            task.share,
        )
        return None

    def discard(self, files: TenantFiles, target: Path) -> None:
        files.drop(target)


class GeometryFieldKind:
    """The geometry field of one mesh."""

    table, lane = schema.geometry_fields.name, "render"
    settings: TypeAdapter[FieldSettings] = TypeAdapter(FieldSettings)

    def source(self, files: TenantFiles, job: Row) -> Path:
        return files.mesh(job["mesh_id"])

    def target(self, files: TenantFiles, job: Row) -> Path:
        return files.field(job["field_id"])

    def run(self, task: Task) -> Row | None:
        settings = self.settings.validate_python(task.settings)
        figures = geometry_field.build(
            ClusterTasks(task.client, PRIORITY, task.share),
            task.source,
            settings,
            task.target,
            task.work_dir,
            task.on_progress,
            task.on_saved,
            task.stop,
        )
        size = geometry_field.bytes_of(task.target)
        found = {"id": task.target.name, "mesh_id": task.source.stem, "bytes": size}
        return {**found, "settings": settings.plain(), "figures": figures}

    def discard(self, files: TenantFiles, target: Path) -> None:
        """Keep it: it is named by its content, and may be another job's too."""


KINDS: Mapping[str, Kind] = MappingProxyType(
    {
        "reconstruction": ReconstructionKind(),
        "simulation": SimulationKind(),
        "refraction": RefractionKind(),
        "geometry-field": GeometryFieldKind(),
    }
)


def _describe(result: Reconstruction) -> Row:
    return {
        "axes": ",".join("xyz"[: result.speed.ndim]),
        "shape": list(result.speed.shape),
        "spacing_m": [finite(value) for value in result.spacing_m],
        "origin_m": [finite(value) for value in result.origin_m],
        "speed_range_mps": [float(result.speed.min()), float(result.speed.max())],
        "water_speed_mps": float(result.water_speed_mps),
        "provenance": {**result.provenance, **({"advice": told(result)} if result.trials else {})},
    }


def finite(value: float) -> float | None:
    """A number that JSON can hold: None for NaN and infinity."""
    return float(value) if math.isfinite(value) else None

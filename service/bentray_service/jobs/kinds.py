"""The kinds of job: reconstruction, simulation, refraction and geometry field, each declared once."""

import math
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, Literal, get_args

import numpy as np
from fastapi.openapi.models import Example
from pydantic import Field, TypeAdapter

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography.model_selection.selection import advice_of, image_label, label
from bentray_kernels.tomography.result import Reconstruction
from bentray_kernels.tomography.settings import Settings
from bentray_kernels.tomography.stored_settings import from_stored
from bentray_workers.files.reconstruction import write_reconstruction
from bentray_workers.reconstruction import reconstruction_run
from bentray_workers.rendering import geometry_field
from bentray_workers.rendering.field_settings import FieldSettings, check_faces
from bentray_workers.rendering.turntable import Turntable, draw_turntable
from bentray_workers.simulation.request import SAMPLE, PhantomScan
from bentray_workers.simulation.simulation_run import simulate_to_file

from ..compute import Compute, check_renderable
from ..files.tenant_files import TenantFiles
from ..rows.ids import Tenant, dataset_of, field_of, volume_of
from ..rows.job_queue import MADE_BY
from ..rows.jobs import NewJob
from ..rows.tables import DatasetRow, FieldRow, JobRow, Plain, ResultVolumeRow
from ..settings_request import DEFAULTS
from .kind import JobRequest, JobRun, Kind, Sources


class ReconstructionRequest(JobRequest):
    """Reconstruct a dataset."""

    kind: Literal["reconstruction"]
    dataset: str = Field(description="Id of an uploaded dataset.")
    settings: Settings = Field(default_factory=Settings, description=DEFAULTS)


class ReconstructionKind(Kind[ReconstructionRequest]):
    """Sound speed from one dataset."""

    request, settings = ReconstructionRequest, TypeAdapter(Settings)
    table, lane, words = ResultVolumeRow, "recon", "Reconstruction"
    example: ClassVar[Example] = {
        "summary": "Sound speed from a scan",
        "value": {
            "kind": "reconstruction",
            "dataset": "ds-0123456789abcdef0123",
            "settings": {"nodes": 128, "iterations": 8, "rays": "curved"},
        },
    }

    def plan(
        self, request: ReconstructionRequest, tenant: Tenant, sources: Sources, compute: Compute
    ) -> NewJob:
        dataset = sources.datasets.get(tenant, request.dataset)
        path = sources.files.of(tenant).dataset(dataset.id)
        settings = in_stated_water(request.settings, dataset)
        plan = compute.plan(dataset.counts, path, settings)
        stored = {"dataset_id": dataset.id, "plan": plan, "reserved": plan["stored_bytes"]}
        return NewJob(request.kind, settings.to_dict(), **stored)

    def source(self, files: TenantFiles, job: JobRow) -> Path:
        return files.dataset(job.dataset_id or "")

    def target(self, files: TenantFiles, job: JobRow) -> Path:
        return files.volume(volume_of(job.id))

    def run(self, run: JobRun) -> Plain | None:
        # A job may have been stored by an earlier version.
        settings = from_stored(run.settings)
        result = reconstruction_run.reconstruct(
            run.client, run.source, settings, work_dir=run.work_dir, **run.control
        )
        if not np.isfinite(result.speed).all():
            found = f"no finite speed at {np.count_nonzero(~np.isfinite(result.speed))} nodes"
            accepted = "settings with which it converges: fewer iterations or larger penalty_strength"
            raise InvalidInput("settings", found, accepted)
        write_reconstruction(run.target, result)
        return {"id": run.target.stem, **_describe(result), "bytes": run.target.stat().st_size}

    def results(self, job: JobRow) -> tuple[dict[str, str], dict[str, str]]:
        volume = volume_of(job.id)
        here = f"/v1/volumes/{volume}"
        return {"volume": volume}, {"volume": here, "image": f"{here}/slice.png", "data": f"{here}/data"}

    def title(self, job: JobRow) -> str:
        """Such as ``Best: full waveform to 450 kHz``: what made the image; before its end, what is asked."""
        asked = job.settings
        method, rays = asked.get("method", "sart"), asked.get("rays", "curved")
        best = method == "waveform" or (method == "auto" and bool(asked.get("minutes")))
        words = {
            "auto": "full waveform where it is better" if best else "rays and method chosen automatically",
            "waveform": "full waveform",
        }.get(method) or label({"rays": rays, "method": method})
        words = (job.plan or {}).get(MADE_BY) or words
        words = words.replace("Gauss-N", "Gauss\N{EN DASH}N")
        grade = "Best: " if best else "Fast: " if method == "auto" else ""
        return grade + words if grade else words[0].upper() + words[1:]


def in_stated_water(settings: Settings, dataset: DatasetRow) -> Settings:
    """The settings with the temperature that the user states for the scan, unless they have their own."""
    stated = dataset.water_temperature_c
    if stated is None or settings.water_temperature_c is not None:
        return settings
    return settings.changed(water_temperature_c=stated)


class SimulationRequest(JobRequest):
    """Simulate a scan of a phantom; the result is a dataset with the ground truth."""

    kind: Literal["simulation"]
    settings: PhantomScan = Field(default_factory=PhantomScan, description=DEFAULTS)


class SimulationKind(Kind[SimulationRequest]):
    """A simulated scan as a dataset."""

    request, settings = SimulationRequest, TypeAdapter(PhantomScan)
    table, lane, words = DatasetRow, "recon", "Simulated scan"
    example: ClassVar[Example] = {
        "summary": "The sample scan: traces of a breast with four lesions",
        "value": {"kind": "simulation", "settings": dict(SAMPLE)},
    }

    def plan(self, request: SimulationRequest, tenant: Tenant, sources: Sources, compute: Compute) -> NewJob:
        plan = compute.plan_simulation(request.settings)
        # The parts, and the file assembled from them.
        return NewJob(request.kind, request.settings.plain(), plan=plan, reserved=2 * plan["result_bytes"])

    def source(self, files: TenantFiles, job: JobRow) -> Path:
        return files.work(job.id)

    def target(self, files: TenantFiles, job: JobRow) -> Path:
        return files.dataset(dataset_of(job.id))

    def run(self, run: JobRun) -> Plain | None:
        request = self.settings.validate_python(run.settings)
        record = simulate_to_file(run.client, request.chosen(), run.target, run.work_dir, **run.control)
        return {"id": run.target.stem, **record}

    def results(self, job: JobRow) -> tuple[dict[str, str], dict[str, str]]:
        dataset = dataset_of(job.id)
        return {"dataset": dataset}, {"dataset": f"/v1/datasets/{dataset}"}


class RefractionRequest(JobRequest):
    """Render a turntable animation of a volume with refraction."""

    kind: Literal["refraction"]
    volume: str = Field(description="Id of a 3-D volume with uniform spacing.")
    settings: Turntable = Field(default_factory=Turntable, description=DEFAULTS)


class RefractionKind(Kind[RefractionRequest]):
    """A turntable animation of one volume; it has no row of its own."""

    request, settings = RefractionRequest, TypeAdapter(Turntable)
    table, lane, words = ResultVolumeRow, "drawing", "Turntable"
    example: ClassVar[Example] = {
        "summary": "A turntable animation of a volume",
        "value": {"kind": "refraction", "volume": "vol-0123456789abcdef0123", "settings": {"format": "zip"}},
    }

    def plan(self, request: RefractionRequest, tenant: Tenant, sources: Sources, compute: Compute) -> NewJob:
        volume, settings = sources.volumes.get(tenant, request.volume), request.settings
        check_renderable(volume)
        plan = compute.plan_turntable(volume.shape, settings)
        low, high = volume.value_range
        stored, most = settings.within(low, high).plain(), settings.largest_bytes
        return NewJob(request.kind, stored, volume_id=volume.id, plan=plan, reserved=most)

    def source(self, files: TenantFiles, job: JobRow) -> Path:
        return files.volume(job.volume_id or "")

    def target(self, files: TenantFiles, job: JobRow) -> Path:
        return files.animation(job.id, job.settings["format"])

    def run(self, run: JobRun) -> Plain | None:
        settings = self.settings.validate_python(run.settings)
        draw_turntable(run.client, run.source, settings, run.target, run.work_dir, **run.control)
        return None

    def results(self, job: JobRow) -> tuple[dict[str, str], dict[str, str]]:
        return {}, {"animation": f"/v1/jobs/{job.id}/animation"}


class GeometryFieldRequest(JobRequest):
    """Build the geometry field of a mesh; a field with the same mesh and settings is reused."""

    kind: Literal["geometry-field"]
    mesh: str = Field(description="Id of a mesh.")
    settings: FieldSettings = Field(default_factory=FieldSettings, description=DEFAULTS)


class GeometryFieldKind(Kind[GeometryFieldRequest]):
    """The geometry field of one mesh."""

    request, settings = GeometryFieldRequest, TypeAdapter(FieldSettings)
    table, lane, words = FieldRow, "drawing", "Geometry field"
    example: ClassVar[Example] = {
        "summary": "The geometry field of a mesh",
        "value": {"kind": "geometry-field", "mesh": "mesh-0123456789abcdef0123"},
    }

    def plan(
        self, request: GeometryFieldRequest, tenant: Tenant, sources: Sources, compute: Compute
    ) -> NewJob:
        mesh, settings = sources.meshes.get(tenant, request.mesh), request.settings
        check_faces(mesh.faces)
        field, most = field_of(settings.content(mesh.content)), settings.largest_bytes(mesh.faces)
        return NewJob(request.kind, settings.plain(), mesh_id=mesh.id, field_id=field, reserved=most)

    def source(self, files: TenantFiles, job: JobRow) -> Path:
        return files.mesh(job.mesh_id or "")

    def target(self, files: TenantFiles, job: JobRow) -> Path:
        return files.field(job.field_id or "")

    def run(self, run: JobRun) -> Plain | None:
        settings = self.settings.validate_python(run.settings)
        paths = run.source, settings, run.target, run.work_dir
        figures = geometry_field.build_field(run.client, *paths, **run.control)
        size = geometry_field.bytes_of(run.target)
        row = {"id": run.target.name, "mesh_id": run.source.stem, "bytes": size}
        return {**row, "settings": settings.plain(), "figures": figures}

    def results(self, job: JobRow) -> tuple[dict[str, str], dict[str, str]]:
        field = job.field_id or ""
        return {"field": field}, field_links(field)

    def discard(self, files: TenantFiles, target: Path) -> None:
        """Keep it: it is identified by its content and may belong to another job, too."""


KINDS: Mapping[str, Kind[Any]] = MappingProxyType(
    {
        get_args(kind.request.model_fields["kind"].annotation)[0]: kind
        for kind in (ReconstructionKind(), SimulationKind(), RefractionKind(), GeometryFieldKind())
    }
)


def field_links(field_id: str) -> dict[str, str]:
    """Links to a geometry field and its images."""
    here = f"/v1/geometry-fields/{field_id}"
    return {
        "field": here,
        "image": f"{here}/image.png",
        "geometry_image": f"{here}/geometry-image.png",
        "normal_map": f"{here}/normal-map.png",
    }


def _describe(result: Reconstruction) -> Plain:
    noted = map(result.provenance.get, ("water", "geometry"))
    cautions = (one.text for one in result.cautions if not one.doubtful)
    notes = [result.doubt, *noted, *cautions, advice_of(result) if result.trials else None]
    # At most what the table of jobs holds.
    advice = " ".join(filter(None, notes))[:2000]
    return {
        "axes": ",".join("xyz"[: result.speed.ndim]),
        "shape": list(result.speed.shape),
        "spacing_m": [finite(value) for value in result.spacing_m],
        "origin_m": [finite(value) for value in result.origin_m],
        "speed_range_mps": [float(result.speed.min()), float(result.speed.max())],
        "water_speed_mps": float(result.water_speed_mps),
        "provenance": {
            **result.provenance,
            MADE_BY: image_label(result),
            **({"advice": advice} if advice else {}),
        },
    }


def finite(value: float) -> float | None:
    """A number for JSON: None for NaN and infinity."""
    return float(value) if math.isfinite(value) else None

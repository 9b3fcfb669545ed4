"""Jobs of all kinds whose memory is measured in workers; each returns the planned sizes of its tasks."""

import tomllib
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from distributed import Client

from bentray_kernels.meshes.example_surfaces import sphere
from bentray_kernels.tomography import Settings
from bentray_workers.cluster.task_costs import TaskSize
from bentray_workers.files.dataset.scan import counts_in
from bentray_workers.files.geometry_field_folder import FieldFiles, read_json
from bentray_workers.files.mesh import StoredMesh, write_mesh
from bentray_workers.files.volume import Volume, write_volume
from bentray_workers.files.volume_export import export_volume
from bentray_workers.images.drawing_tasks import volume_slice_png
from bentray_workers.reconstruction.planning import plan, task_sizes
from bentray_workers.reconstruction.quality_report import quality_page
from bentray_workers.reconstruction.reconstruction_run import reconstruct
from bentray_workers.reconstruction.scan_views import emission_traces, scan_geometry
from bentray_workers.rendering import field_picture, picture_cost, refraction, tiles
from bentray_workers.rendering.coefficients import coefficients_npy
from bentray_workers.rendering.field_settings import FieldSettings
from bentray_workers.rendering.field_view import FieldView
from bentray_workers.rendering.geometry_field import build_field
from bentray_workers.rendering.histogram import volume_histogram
from bentray_workers.rendering.isosurface_mesh import mesh_volume
from bentray_workers.rendering.picture_cost import Cost, VolumeFile
from bentray_workers.rendering.refraction_view import RefractionView
from bentray_workers.simulation.cost import task_sizes as simulated_sizes
from bentray_workers.simulation.request import PhantomScan
from bentray_workers.simulation.simulation_run import simulate_to_file

from ..shared._synthetic_scan import made_up_scan, made_up_traces

Plan = Mapping[str, TaskSize | Cost]

# Runs a job with the client of a worker in a folder; returns the plans of its tasks by name, or that of a
# picture.
Run = Callable[[Client, Path], Plan]


class Job(NamedTuple):
    """A job of one size.

    Attributes:
        name: of its kind.
        size: in ``jobs.toml``.
        run: the job.
        warm: small ones, which load libraries and compiled code: plans are above a warm worker.
    """

    name: str
    size: tuple[Any, ...]
    run: Run
    warm: tuple[Run, ...]

    def __str__(self) -> str:
        return f"{self.name}, {' x '.join(str(part) for part in self.size)}"


def by_times(_kind: str, asked: dict[str, Any], client: Client, folder: Path, *size: Any) -> Plan:
    """Reconstruct from travel times; the size is of elements, emitters, nodes, slices and their pitch, m."""
    elements, emitters, nodes, slices, pitch_m = (*size, *(1, 0.003)[len(size) - 3 :])
    path = folder / "times.h5"
    if not path.exists():
        made_up_scan(path, elements, slices, emitters, pitch_m, losses=asked["attenuation"])
    return _reconstructed(client, path, {"nodes": nodes, **asked})


def by_traces(
    _kind: str, asked: dict[str, Any], client: Client, folder: Path, elements: int, samples: int
) -> Plan:
    """Pick times of traces, and reconstruct."""
    settings = {"nodes": 48, **asked}
    kind = {name: settings.pop(name) for name in ("water", "real") if name in settings}
    centre_hz = settings.pop("centre_hz", 2.5e5 if asked.get("method") == "waveform" else 1e6)
    path = folder / "traces.h5"
    if not path.exists():
        made_up_traces(path, elements, samples, centre_hz, **kind)
    return _reconstructed(client, path, settings)


def _reconstructed(client: Client, path: Path, asked: dict[str, Any]) -> Plan:
    usual = {"method": "sart", "decomposition": "slices", "iterations": 2, "uncertainty": False}
    settings = Settings.from_values(**{**usual, **asked})
    reconstruct(client, path, settings)
    scan = counts_in(path).summary(settings)
    fitted, planned = task_sizes(scan, settings), plan(scan, settings, ()).call_bytes
    return {name: fitted.get(name, Cost(0.0, size)) for name, size in planned.items()}


def by_phantom(_kind: str, asked: dict[str, Any], client: Client, folder: Path) -> Plan:
    """Simulate a scan."""
    settings = PhantomScan(**asked).chosen()
    simulate_to_file(client, settings, folder / "scan.h5")
    return simulated_sizes(settings)


def by_volume(
    kind: str, style: dict[str, Any], client: Client, folder: Path, nodes: int, pixels: int = 400
) -> Plan:
    """Draw or export an uploaded volume of nodes³ float32; ``style`` is that of a slice."""
    x = np.linspace(-1.0, 1.0, nodes, dtype=np.float32) ** 2
    path, shape = folder / f"{nodes}.h5", (nodes,) * 3
    write_volume(path, Volume.from_values(x[:, None, None] + x[:, None] + x, (1e-3,) * 3))
    stored = VolumeFile.from_row({"shape": shape, "bytes": 4 * nodes**3})
    view = RefractionView(iso=(0.9,), width=pixels, height=pixels)
    if kind == "refraction":
        tiles.submit(client, refraction.tasks_of(path, view), 0).result()
        return {kind: Cost(0.0, picture_cost.refraction_bytes(shape, view))}
    written: dict[str, Any] = {"target": folder / "exported", "name": kind}
    task, options, cost = {
        "slice": (volume_slice_png, {**style, "size": pixels}, partial(picture_cost.slice_cost, size=pixels)),
        "histogram": (volume_histogram, {"quantity": "value", "bins": 256}, picture_cost.filter_cost),
        "coefficients": (coefficients_npy, {"view": RefractionView()}, picture_cost.filter_cost),
        "mesh": (
            mesh_volume,
            {"iso": None, "step": 8, "target": folder / "mesh"},
            partial(picture_cost.mesh_cost, step=8),
        ),
    }.get(kind, (export_volume, written, partial(picture_cost.export_cost, name=kind)))
    _call(client, task, path, **options)
    return {kind: cost(stored)}


def by_field(
    _kind: str, _asked: dict[str, Any], client: Client, folder: Path, samples: int, image: int, pixels: int
) -> Plan:
    """Draw a geometry field and its map; the size is of samples, and of pixels of image and picture."""
    mesh, target = folder / "mesh.h5", folder / f"field {samples} {image}"
    (folder / "work").mkdir(exist_ok=True)
    write_mesh(mesh, StoredMesh(sphere(samples, samples + 1)))
    settings = FieldSettings(samples=samples, inner_samples=samples, divisions=8, image_size=image)
    # Here and not on the worker, whose memory is that of the pictures alone.
    build_field(None, mesh, settings, target, folder / "work")
    figures, view = read_json(FieldFiles(target).figures), FieldView(width=pixels, height=pixels)
    _call(client, field_picture.map_png, target, "positions")
    tiles.submit(client, field_picture.tasks_of(target, view), 0).result()
    return {"map": picture_cost.map_cost(figures), "field": picture_cost.field_cost(figures, view)}


def by_scan(
    kind: str, _asked: dict[str, Any], client: Client, folder: Path, elements: int, samples: int
) -> Plan:
    """Show a scan with traces."""
    path = made_up_traces(folder / f"{elements}.h5", elements, samples, 1e6)
    row = {
        "ntx": elements,
        "nrx": elements,
        "slices": 1,
        "has_traces": True,
        "bytes": path.stat().st_size,
    }
    task, options, cost = {
        "quality": (quality_page, {"picker": "aic"}, picture_cost.quality_cost),
        "geometry": (scan_geometry, {}, picture_cost.geometry_cost),
        "emission": (
            emission_traces,
            {"emission": 3, "index": 0, "what": "object"},
            picture_cost.emission_cost,
        ),
    }[kind]
    _call(client, task, path, **options)
    return {kind: cost(row)}


def _call(client: Client, task: Callable[..., Any], *arguments: Any, **options: Any) -> None:
    client.submit(task, *arguments, **options, pure=False).result()


RUNS = (by_times, by_traces, by_phantom, by_volume, by_field, by_scan)


def _run_of(name: str, kind: dict[str, Any], size: list[Any]) -> Run:
    asked = dict(kind["asked"])
    for settings in size:
        asked |= settings if isinstance(settings, dict) else {}
    numbers = [part for part in size if not isinstance(part, dict)]
    run: Callable[..., Plan] = next(run for run in RUNS if run.__name__ == f"by_{kind['run']}")
    return lambda client, folder: run(name, asked, client, folder, *numbers)


KINDS = tomllib.loads(Path(__file__).with_name("jobs.toml").read_text(encoding="utf-8"))
FITTED, JUDGED = (
    tuple(
        Job(name, tuple(size), _run_of(name, kind, size), tuple(_run_of(name, kind, w) for w in kind["warm"]))
        for name, kind in KINDS.items()
        for size in kind[sizes]
    )
    for sizes in ("fitted", "judged")
)
QUICK = ("sart", "slice")

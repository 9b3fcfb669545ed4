"""Jobs of all kinds whose memory is measured in workers; each returns the plan of its tasks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from distributed import Client

from bentray_kernels.meshes.example_surfaces import sphere
from bentray_kernels.tomography import Settings
from bentray_workers.files.dataset.scan import counts_in
from bentray_workers.files.export.registry import EXPORTED
from bentray_workers.files.geometry_field_folder import FieldFiles, read_json
from bentray_workers.files.mesh import StoredMesh, write_mesh
from bentray_workers.files.volume import Volume, write_volume
from bentray_workers.files.volume_export import export_volume
from bentray_workers.images.drawing_tasks import volume_slice_png
from bentray_workers.reconstruction.planning import plan
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
from bentray_workers.rendering.picture_cost import VolumeFile
from bentray_workers.rendering.refraction_view import RefractionView
from bentray_workers.simulation.request import PhantomScan
from bentray_workers.simulation.simulation_planning import plan_simulation
from bentray_workers.simulation.simulation_run import simulate_to_file

from ..shared._synthetic_scan import made_up_scan, made_up_traces

Bytes = dict[str, int]


class Job(NamedTuple):
    """A job of one size.

    Attributes:
        name: of its kind.
        run: takes the client of a worker, a folder and a size; returns the planned bytes by task.
        size: further arguments of ``run``.
        warm: a small size, which loads libraries and compiled code: plans are above a warm worker.
    """

    name: str
    run: Callable[..., Bytes]
    size: tuple[Any, ...]
    warm: tuple[Any, ...]

    def __str__(self) -> str:
        return f"{self.name}, {' x '.join(str(part) for part in self.size)}"


def by_times(asked: dict[str, Any], client: Client, folder: Path, *size: float) -> Bytes:
    """Reconstruct from travel times; the size is of elements, emitters, nodes, slices and their pitch, m."""
    elements, emitters, nodes, slices, pitch_m = size
    path = folder / "times.h5"
    losses = "attenuation" in asked
    made_up_scan(path, int(elements), int(slices), int(emitters), pitch_m, losses=losses)
    return _reconstructed(client, path, {"nodes": nodes, "iterations": 2, **asked})


def by_traces(asked: dict[str, Any], client: Client, folder: Path, elements: int, samples: int) -> Bytes:
    """Pick times of traces, and reconstruct."""
    centre_hz = 2.5e5 if asked.get("method") == "waveform" else 1e6
    path = made_up_traces(folder / "traces.h5", elements, samples, centre_hz)
    return _reconstructed(client, path, {"nodes": 48, "iterations": 2, **asked})


def _reconstructed(client: Client, path: Path, asked: dict[str, Any]) -> Bytes:
    settings = Settings.from_values(**{"method": "sart", "decomposition": "slices", **asked})
    reconstruct(client, path, settings)
    return dict(plan(counts_in(path).summary(settings), settings, ()).call_bytes)


def by_phantom(asked: dict[str, Any], client: Client, folder: Path, size: dict[str, Any]) -> Bytes:
    """Simulate a scan."""
    request = PhantomScan(**asked, **size)
    simulate_to_file(client, request.chosen(), folder / "scan.h5")
    return dict(plan_simulation(request, ()).call_bytes)


def by_volume(name: str, client: Client, folder: Path, nodes: int, pixels: int = 400) -> Bytes:
    """Draw or export an uploaded volume of nodes³ float32."""
    x = np.linspace(-1.0, 1.0, nodes, dtype=np.float32) ** 2
    path, shape = folder / f"{nodes}.h5", (nodes,) * 3
    write_volume(path, Volume.from_values(x[:, None, None] + x[:, None] + x, (1e-3,) * 3))
    stored = VolumeFile.from_row({"shape": shape, "bytes": 4 * nodes**3})
    view = RefractionView(iso=(0.9,), width=pixels, height=pixels)
    if name == "refraction":
        tiles.submit(client, refraction.tasks_of(path, view), 0).result()
        return {name: picture_cost.refraction_bytes(shape, view)}
    written: dict[str, Any] = {"target": folder / "exported", "name": name}
    task, options, cost = {
        "slice": (volume_slice_png, {"size": pixels}, partial(picture_cost.slice_cost, size=pixels)),
        "histogram": (volume_histogram, {"quantity": "value", "bins": 256}, picture_cost.filter_cost),
        "coefficients": (coefficients_npy, {"view": RefractionView()}, picture_cost.filter_cost),
        "mesh": (
            mesh_volume,
            {"iso": None, "step": 8, "target": folder / "mesh"},
            partial(picture_cost.mesh_cost, step=8),
        ),
    }.get(name, (export_volume, written, partial(picture_cost.export_cost, name=name)))
    _call(client, task, path, **options)
    return {name: cost(stored).bytes}


def by_field(client: Client, folder: Path, samples: int, image: int, pixels: int) -> Bytes:
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
    return {
        "map": picture_cost.map_cost(figures).bytes,
        "field": picture_cost.field_cost(figures, view).bytes,
    }


def by_scan(name: str, client: Client, folder: Path, elements: int, samples: int) -> Bytes:
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
    }[name]
    _call(client, task, path, **options)
    return {name: cost(row).bytes}


def _call(client: Client, task: Callable[..., Any], *arguments: Any, **options: Any) -> None:
    client.submit(task, *arguments, **options, pure=False).result()


PLANAR, DEEP = {"attenuation": False}, {"attenuation": False, "decomposition": "volume"}
STRAIGHT, NEWTON = {"rays": "straight"}, {"method": "gauss-newton"}
MAPS = {"attenuation": True, "resolution_check": True, "uncertainty": True}
# Elements, emitters, nodes, slices, pitch; a pitch of a radius gives half as many heights as nodes.
TIMES: dict[str, tuple[dict[str, Any], tuple[tuple[float, ...], ...]]] = {
    "sart": (PLANAR, ((384, 0, 256, 1, 0), (256, 16, 512, 3, 0.003), (64, 2, 2048, 1, 0))),
    "sart straight": (PLANAR | STRAIGHT, ((1024, 32, 128, 1, 0), (64, 8, 1024, 1, 0))),
    "gauss-newton": (PLANAR | NEWTON, ((128, 64, 160, 1, 0), (256, 32, 128, 4, 0.003))),
    "gauss-newton straight": (
        PLANAR | NEWTON | STRAIGHT,
        ((512, 128, 192, 1, 0), (256, 64, 128, 6, 0.003), (64, 8, 2048, 1, 0)),
    ),
    "maps straight": (MAPS | STRAIGHT, ((128, 64, 96, 1, 0), (256, 64, 160, 1, 0))),
    "maps straight, gauss-newton": (MAPS | STRAIGHT | NEWTON, ((192, 64, 128, 1, 0),)),
    "volume, sart": (DEEP, ((16, 2, 96, 2, 0.08), (8, 1, 200, 2, 0.08))),
    "volume, sart straight": (DEEP | STRAIGHT, ((32, 4, 160, 2, 0.08), (16, 2, 256, 2, 0.08))),
    "volume, gauss-newton": (DEEP | NEWTON, ((32, 8, 64, 4, 0.02), (16, 2, 128, 2, 0.08))),
    "volume, gauss-newton straight": (
        DEEP | NEWTON | STRAIGHT,
        ((128, 64, 64, 6, 0.01), (32, 4, 128, 2, 0.08), (16, 2, 200, 2, 0.08)),
    ),
    "volume in 3 blocks": (DEEP | {"blocks": 3, "iterations": 1}, ((8, 1, 128, 2, 0.08),)),
    "volume in 3 blocks, straight": (
        DEEP | STRAIGHT | {"blocks": 3, "iterations": 1},
        ((16, 2, 128, 2, 0.08), (16, 2, 240, 2, 0.08)),
    ),
}
# Elements and samples.
TRACES: dict[str, tuple[dict[str, Any], tuple[tuple[int, int], ...]]] = {
    "picking": (PLANAR, ((48, 6000), (128, 2400))),
    "picking, matched": (PLANAR | {"picker": "matched"}, ((64, 3000), (48, 12_000))),
    "reflection": (PLANAR | {"reflection": True}, ((64, 1500), (48, 6000))),
    "waveform": (PLANAR | {"method": "waveform", "bands": 1, "emitters": 8}, ((48, 260), (96, 300))),
}
PHANTOMS: dict[str, tuple[dict[str, Any], tuple[dict[str, Any], ...]]] = {
    "simulation": ({"elements": 4}, ({"nodes": 400}, {"nodes": 800})),
    "simulation in space": (
        {"phantom": "table7", "three_d": True, "refinement": 2, "slices": 2, "elements": 4},
        ({"nodes": 64}, {"nodes": 128}),
    ),
    "simulation of waves": ({"waveform": True, "emissions": 1, "elements": 64}, ({"frequency_hz": 3e5},)),
}
# Nodes, and pixels.
VOLUMES: dict[str, tuple[tuple[int, ...], ...]] = {
    "slice": ((200,), (24, 3000)),
    "refraction": ((100,), (220,), (24, 3000)),
    **dict.fromkeys(("histogram", "coefficients", "mesh"), ((100,), (260,))),
    **dict.fromkeys(EXPORTED, ((260,),)),
}
QUICK = ("sart", "slice")


def jobs() -> Iterator[Job]:
    """All sizes of all kinds."""
    for name, (asked, sizes) in TIMES.items():
        small = (16, 4, 24, 2 if "volume" in name else 1, 0.08)
        for size in sizes:
            yield Job(name, partial(by_times, asked), size, small)
    for name, (asked, sizes) in TRACES.items():
        for size in sizes:
            yield Job(name, partial(by_traces, asked), size, (16, 260 if name == "waveform" else 700))
    for name, (asked, phantoms) in PHANTOMS.items():
        for phantom in phantoms:
            small_phantom = {"frequency_hz": 5e4} if "waves" in name else {"nodes": 16}
            yield Job(name, partial(by_phantom, asked), (phantom,), (small_phantom,))
    for name, shapes in VOLUMES.items():
        for shape in shapes:
            yield Job(name, partial(by_volume, name), shape, (16,))
    for field in ((6, 65, 64), (16, 257, 64), (6, 513, 3000)):
        yield Job("geometry field", by_field, field, (6, 33, 16))
    for name in ("quality", "geometry", "emission"):
        yield Job(name, partial(by_scan, name), (96, 3000), (16, 700))


JOBS = tuple(jobs())

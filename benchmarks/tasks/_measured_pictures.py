"""Pictures, exports and simulated scans that are measured for the table of task costs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np

from bentray_kernels.acquisition import Truth
from bentray_kernels.meshes.example_surfaces import sphere
from bentray_kernels.tomography import Reconstruction, Settings
from bentray_workers.cluster.task_costs import TaskSize
from bentray_workers.files.dataset import read_dataset, write_dataset
from bentray_workers.files.export.registry import EXPORTED
from bentray_workers.files.geometry_field_folder import FieldFiles, read_json
from bentray_workers.files.mesh import StoredMesh, write_mesh
from bentray_workers.files.reconstruction import write_reconstruction
from bentray_workers.files.volume import Volume, write_volume
from bentray_workers.files.volume_export import export_volume
from bentray_workers.images.drawing_tasks import slice_png, volume_slice_png
from bentray_workers.images.result_summary import result_summary
from bentray_workers.images.truth_export import export_truth
from bentray_workers.reconstruction.quality_report import quality_page
from bentray_workers.reconstruction.scan_views import emission_traces, scan_geometry
from bentray_workers.rendering import field_picture, picture_cost, refraction
from bentray_workers.rendering.coefficients import coefficients_npy
from bentray_workers.rendering.field_settings import FieldSettings
from bentray_workers.rendering.field_view import FieldView
from bentray_workers.rendering.geometry_field import build_field
from bentray_workers.rendering.histogram import volume_histogram
from bentray_workers.rendering.isosurface_mesh import mesh_volume
from bentray_workers.rendering.picture_cost import Cost, VolumeFile
from bentray_workers.rendering.refraction_view import RefractionView
from bentray_workers.rendering.tiles import PictureTasks
from bentray_workers.simulation.assembly import write_scan
from bentray_workers.simulation.cost import task_sizes, work_of
from bentray_workers.simulation.parts import make_part, parts_of
from bentray_workers.simulation.request import PhantomScan

from ..shared._synthetic_scan import made_up_scan, made_up_traces
from ._measured_tasks import WORK, Job
from ._task_peaks import call, set_idle


def ball(folder: Path, nodes: int, *, uploaded: bool) -> tuple[Path, VolumeFile]:
    """A volume of float32, or a reconstruction with all images, of nodes³; and what its row says."""
    x = np.linspace(-1.0, 1.0, nodes, dtype=np.float32)
    values = x[:, None, None] ** 2 + x[None, :, None] ** 2 + x[None, None, :] ** 2
    path, row = folder / f"ball {nodes} {uploaded}.h5", {"shape": (nodes,) * 3, "bytes": 4 * nodes**3}
    if uploaded:
        write_volume(path, Volume.from_values(values, (1e-3,) * 3))
        return path, VolumeFile.from_row(row)
    images = dict.fromkeys(("coverage", "attenuation", "recovery"), values.astype(np.float64))
    side = 0.5e-3 * (nodes - 1)
    result = Reconstruction(
        speed=1500.0 + 20.0 * images["coverage"],
        **images,
        spacing_m=(1e-3,) * 3,
        origin_m=(-side,) * 3,
        water_speed_mps=1500.0,
        settings=Settings.from_values(method="sart"),
        history=(),
    )
    write_reconstruction(path, result)
    return path, VolumeFile.from_row({**row, "job_id": 1})


def by_volume(
    task: Callable[..., Any],
    cost: Callable[[VolumeFile, Any], Cost],
    options: Callable[[Path, Any], dict[str, Any]],
    client: None,
    folder: Path,
    size: tuple[int, bool, Any],
) -> dict[str, TaskSize]:
    """Call a task with a volume; the size is of nodes along a side, of an upload, and an option."""
    nodes, uploaded, option = size
    path, stored = ball(folder, nodes, uploaded=uploaded)
    call(client, task, path, **options(folder, option))
    return {task.__name__: cost(stored, option).size}


def call_picture(tasks: PictureTasks) -> None:
    """Draw a tile of a picture, and stack as many copies of it as the picture has tiles."""
    function, *arguments = tasks.tiles[len(tasks.tiles) // 2]
    call(None, function, *arguments)
    if tasks.stack is not None:
        drawn = function(*arguments)
        copies = [drawn._replace(image=drawn.image.copy()) for _ in tasks.tiles]
        set_idle(None)
        call(None, tasks.stack, copies)


def picture_sizes(tile: TaskSize, view: RefractionView | FieldView) -> dict[str, TaskSize]:
    """Of the tasks of a picture, of one or of many tiles."""
    return {"picture_png": tile, "viewer_tile": tile, "stack_png": picture_cost.stacking_size(view)}


def by_tile(client: None, folder: Path, size: tuple[int, int, bool]) -> dict[str, TaskSize]:
    """Draw a tile of a ball of glass; the size is of nodes along a side, of pixels, and of an upload."""
    nodes, pixels, uploaded = size
    path, _ = ball(folder, nodes, uploaded=uploaded)
    view = RefractionView(iso=(0.9 if uploaded else 1520.0,), width=pixels, height=pixels)
    call_picture(refraction.tasks_of(path, view))
    return picture_sizes(picture_cost.refraction_size((nodes,) * 3, view), view)


def by_field(task: str, client: None, folder: Path, size: tuple[int, int, int, str]) -> dict[str, TaskSize]:
    """Draw a geometry field; the size is of samples, pixels of image and picture, and the lookup."""
    samples, image, pixels, lookup = size
    mesh, target, work = folder / "mesh.h5", folder / "-".join(map(str, size)), folder / "work"
    work.mkdir(exist_ok=True)
    write_mesh(mesh, StoredMesh(sphere(samples, samples + 1)))
    settings = FieldSettings(samples=samples, inner_samples=samples, divisions=8, image_size=image)
    build_field(None, mesh, settings, target, work)
    figures, view = (
        read_json(FieldFiles(target).figures),
        FieldView(width=pixels, height=pixels, lookup=lookup),
    )
    if task == "map":
        call(client, field_picture.map_png, target, "positions")
        return {"map_png": picture_cost.map_cost(figures).size}
    call_picture(field_picture.tasks_of(target, view))
    return picture_sizes(picture_cost.field_size(figures, view), view)


def by_scan(
    task: Callable[..., Any],
    cost: Callable[[dict[str, Any]], Cost],
    options: dict[str, Any],
    client: None,
    folder: Path,
    size: tuple[int, int],
) -> dict[str, TaskSize]:
    """Call a task with a scan; the size is of elements and samples, 0 for travel times."""
    elements, samples = size
    if samples:
        path = made_up_traces(folder / "scan.h5", elements, samples)
    else:
        path = made_up_scan(folder / "scan.h5", elements, 1, losses=True)
    row = {"ntx": elements, "nrx": elements, "slices": 1, "has_traces": samples > 0}
    call(client, task, path, **options)
    return {task.__name__: cost({**row, "bytes": path.stat().st_size}).size}


def by_truth(
    task: Callable[..., Any], client: None, folder: Path, size: tuple[int, int]
) -> dict[str, TaskSize]:
    """Compare with the truth of a scan; the size is of elements and nodes along a side."""
    elements, nodes = size
    scan, volume = folder / f"{size}.h5", folder / f"volume {size}.h5"
    image, side = np.random.default_rng(0).normal(1500.0, 10.0, (nodes, nodes)), 0.2 / (nodes - 1)
    dataset = read_dataset(made_up_scan(scan, elements, 1, losses=True))
    truth = Truth(image, (side, side), (-0.1, -0.1))
    write_dataset(scan, replace(dataset, truth=truth))
    result = Reconstruction(
        speed=image,
        coverage=image,
        attenuation=image,
        recovery=image,
        spacing_m=(side,) * 2,
        origin_m=(-0.1,) * 2,
        water_speed_mps=1500.0,
        settings=Settings.from_values(method="sart"),
        history=(),
    )
    write_reconstruction(volume, result)
    target = {"target": folder / "truth", "name": "npy"} if task is export_truth else {}
    call(client, task, volume, scan=scan, **target)
    row = {"ntx": elements, "nrx": elements, "slices": 1, "has_traces": False, "bytes": scan.stat().st_size}
    stored = VolumeFile.from_row({"shape": (nodes, nodes), "job_id": 1})
    cost = picture_cost.truth_cost if task is export_truth else picture_cost.summary_cost
    return {task.__name__: cost(stored, row).size}


def by_simulation(
    asked: dict[str, Any], client: None, folder: Path, size: dict[str, Any]
) -> dict[str, TaskSize]:
    """Simulate a scan; the size is of more settings."""
    settings = PhantomScan(**asked, **size).chosen()
    parts = Path(mkdtemp(dir=folder))
    for part in parts_of(settings):
        call(client, make_part, settings, part, parts)
    call(client, write_scan, settings, parts, folder / "scan.h5")
    return {**task_sizes(settings), WORK: work_of(settings)}


# Nodes along a side, whether it is an upload, and an option; checks after them.
CUBES = ((24, True, None), (100, True, None), (160, True, None), (60, False, None), (100, False, None))
WRITTEN = CUBES[0], CUBES[2], CUBES[4], (130, True, None)
CHECKS = ((130, True, None), (80, False, None))
DRAWN = (
    *((24, True, 400), (180, True, 400), (120, True, 1200), (24, True, 3000)),
    *((24, False, 400), (100, False, 400), (60, False, 1200), (24, False, 3000)),
)


def picture_jobs() -> Iterator[Job]:
    """Pictures and exports, each of the first of a worker: it loads the libraries."""
    for uploaded, task in ((True, volume_slice_png), (False, slice_png)):
        run = partial(
            by_volume, task, picture_cost.slice_cost, lambda _, size: {"size": size, "frame": False}
        )
        sizes = [size for size in DRAWN if size[1] is uploaded]
        yield Job(f"picture, {task.__name__}", run, None, sizes, ((90, uploaded, 1800),))
    for name in EXPORTED:
        run = partial(
            by_volume,
            export_volume,
            lambda stored, _, name=name: picture_cost.export_cost(stored, name),
            lambda folder, _, name=name: {"target": folder / "exported", "name": name},
        )
        yield Job(f"picture, export to {name}", run, None, WRITTEN, CHECKS[1:])
    for task, cost, options in (
        (coefficients_npy, picture_cost.coefficients_cost, lambda *_: {"view": RefractionView()}),
        (
            mesh_volume,
            picture_cost.mesh_cost,
            lambda folder, _: {"iso": None, "step": 8, "target": folder / "mesh"},
        ),
    ):
        run = partial(by_volume, task, lambda stored, _, cost=cost: cost(stored), options)
        yield Job(f"picture, {task.__name__}", run, None, CUBES, CHECKS)
    for quantity, uploaded in (("value", True), ("speed", False)):
        run = partial(
            by_volume,
            volume_histogram,
            lambda stored, _: picture_cost.histogram_cost(stored),
            lambda *_, quantity=quantity: {"quantity": quantity, "bins": 256},
        )
        sizes, checks = ([size for size in each if size[1] is uploaded] for each in (CUBES, CHECKS))
        yield Job(f"picture, histogram of {quantity}", run, None, sizes, checks)
    tiles = (
        (24, 64, True),
        (24, 4096, True),
        (100, 1024, True),
        (200, 64, True),
        (60, 1024, False),
        (110, 64, False),
    )
    yield Job("picture, refraction", by_tile, None, tiles, ((150, 2000, True), (80, 300, False)))
    fields = (
        (6, 65, 64, "exact"),
        (16, 257, 64, "exact"),
        (20, 65, 1024, "exact"),
        (24, 513, 64, "nearest"),
        (6, 65, 4000, "exact"),
        (12, 129, 64, "uv-nearest"),
        (20, 257, 64, "uv-nearest"),
    )
    yield Job("picture, geometry field", partial(by_field, "field"), None, fields, ((20, 129, 500, "exact"),))
    maps = (6, 65, 64, "exact"), (6, 257, 64, "exact"), (6, 513, 64, "exact")
    yield Job("picture, map", partial(by_field, "map"), None, maps, ((6, 385, 64, "exact"),))
    scans = (32, 800), (96, 1500), (128, 600), (48, 4000), (256, 0), (512, 0)
    for task, cost, options in (
        (quality_page, picture_cost.quality_cost, {"picker": "aic"}),
        (scan_geometry, picture_cost.geometry_cost, {}),
        (emission_traces, picture_cost.emission_cost, {"emission": 3, "index": 0, "what": "object"}),
    ):
        sizes = [size for size in scans if size[1] or task is not emission_traces]
        yield Job(
            f"picture, {task.__name__}", partial(by_scan, task, cost, options), None, sizes, ((80, 2000),)
        )
    for task in (result_summary, export_truth):
        sizes = ((32, 64), (256, 64), (64, 512), (256, 400))
        yield Job(f"picture, {task.__name__}", partial(by_truth, task), None, sizes, ((128, 300),))


def simulation_jobs() -> Iterator[Job]:
    """Simulated scans by travel times and by waves, in planes and in space."""
    times, waves = ("nodes", "elements"), ("frequency_hz", "elements", "nodes")
    space: dict[str, Any] = {"phantom": "table7", "slices": 3}
    deep: dict[str, Any] = {"three_d": True, "refinement": 2}
    level: dict[str, Any] = {"waveform": True, "emissions": 2}
    jobs: tuple[tuple[dict[str, Any], tuple[str, ...], Any, Any], ...] = (
        ({}, times, ((64, 48), (32, 400), (200, 8), (256, 4)), (100, 64)),
        ({"attenuation": True, "snr": 10.0}, times, ((64, 48), (32, 400), (80, 100), (160, 4)), (110, 24)),
        (space, times, ((64, 16), (32, 200), (128, 4)), (80, 32)),
        (space | deep, times, ((36, 6), (48, 4), (64, 3)), (40, 4)),
        (
            level,
            waves,
            ((2e5, 128, 64), (4e5, 64, 64), (2e5, 512, 256), (3e5, 256, 256)),
            (3e5, 128, 128),
        ),
        (
            {"phantom": "table7", **level, "emissions": 1},
            waves,
            ((3e4, 64, 64), (5e4, 128, 64), (3e4, 512, 256)),
            (4e4, 128, 128),
        ),
    )
    for asked, names, *each in jobs:
        sizes, check = each
        given = [dict(zip(names, size, strict=True)) for size in (check, *sizes)]
        run = partial(by_simulation, asked)
        yield Job(f"simulation, {asked}", run, None, given[1:], given[:1])


JOBS = (*picture_jobs(), *simulation_jobs())

"""Ahead-of-time compilation of the kernels of all kinds of jobs, for an image and before tests.

Run it as ``python -m bentray_workers.compilation.precompile``. Numba compiles at the first call, so each
kind of job runs once on the smallest scan that has all it needs. What is compiled here is loaded when it is
first called. A second run for the same sources ends at once.
"""

import hashlib
import os
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from llvmlite import binding  # type: ignore[import-untyped]

from bentray_kernels.acquisition import PICKERS, Dataset, Waveform
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.compilation.sources import ROOT, digest
from bentray_kernels.eikonal import methods
from bentray_kernels.geometry_field.tables.inner_field import build_inner_rows, inner_field, spread_points
from bentray_kernels.geometry_field.tables.outer_field import build_rows, outer_field
from bentray_kernels.geometry_field.tracing.packed_scene import world_of
from bentray_kernels.geometry_field.tracing.ray_tracer import TraceSettings, trace
from bentray_kernels.geometry_field.tracing.scene import Shape
from bentray_kernels.meshes.example_surfaces import bumpy_ball, sphere
from bentray_kernels.meshes.mesh import Chart
from bentray_kernels.meshes.surface import surface_of
from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_kernels.splines import FILTERS
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography import reconstruct as reconstruct_here
from bentray_kernels.tomography.gauss_newton.penalties import PENALTIES

from ..files.dataset import write_dataset
from ..files.mesh import StoredMesh, write_mesh
from ..files.volume import Volume
from ..reconstruction import quality_report as quality
from ..reconstruction.reconstruction_run import reconstruct
from ..rendering import field_picture, geometry_field
from ..rendering.field_scenes import camera_of, scene_of
from ..rendering.field_settings import FieldSettings
from ..rendering.field_view import FieldView
from ..rendering.refraction import draw_tile
from ..rendering.refraction_view import RefractionView
from ..rendering.scene_cache import build_scene, filter_volume
from ..simulation.plane import SimulationSettings
from ..simulation.simulation_run import simulate
from ..simulation.volume import VolumeSimulationSettings
from ..simulation.volume_waves import VolumeWaveSettings
from ..simulation.waves import WaveSimulationSettings, simulate_emission
from .cache_misses import compiled_kernels

# Along a side of every image.
NODES = 24

TIMES = SimulationSettings(nodes=16, elements=16, coupling_mps=1375.0, attenuation=True)
HEIGHTS = VolumeSimulationSettings(nodes=32, slices=2, elements=8, refinement=4, coupling_mps=1375.0)
SPACE = replace(HEIGHTS, refinement=2, three_d=True)
WAVES = WaveSimulationSettings(frequency_hz=2e5, side_m=0.05, elements=24, emissions=12, nodes=32)
WAVES_IN_SPACE = VolumeWaveSettings(frequency_hz=1e5, side_m=0.03, elements=8, emissions=1, nodes=16)


def time_settings() -> Iterator[dict[str, Any]]:
    """The settings of reconstructions from travel times and amplitudes."""
    yield {"resolution_check": True, "uncertainty": True}
    yield {"rays": "straight", "reciprocity": False}
    yield {"eikonal": "accurate", "speed_range_mps": (1300.0, 1600.0)}
    yield {"method": "auto"}
    for rays, penalty in product(("curved", "straight"), PENALTIES):
        yield {"method": "gauss-newton", "rays": rays, "penalty": penalty}
    yield {"method": "gauss-newton", "ray_width_m": 5e-3}


def slice_settings() -> Iterator[dict[str, Any]]:
    """Settings for several slices."""
    for method, decomposition in product(("sart", "gauss-newton"), ("slices", "volume")):
        yield {"method": method, "decomposition": decomposition, "attenuation": False}


def trace_settings() -> Iterator[dict[str, Any]]:
    """Settings for traces."""
    for picker in PICKERS:
        yield {"picker": picker, "attenuation": False}
    yield {"amplitudes": "ratio", "focusing": True}
    yield {"amplitudes": "spectrum", "reflection": True, "pixel_m": 5e-3}
    yield {"method": "waveform", "bands": 1, "emitters": 4}


def digitised(scan: Dataset) -> Dataset:
    """A scan with traces of 16-bit integers, as from scanners."""
    pair = (scan.traces.object, scan.traces.water_traces)
    step = max(float(np.abs(traces).max()) for traces in pair) / np.iinfo(np.int16).max
    both = [(traces / step).round().astype(np.int16) for traces in pair]
    return replace(scan, waveform=Waveform(both[0], both[1], scale=step))


def warm_up() -> None:
    """Reconstruct eight elements in water with every solver but OpenCL and with both kinds of ray.

    OpenCL devices are tested on demand.
    """
    elements = np.arange(8)
    water = Dataset(Ring(8, 0.01).positions(), elements, elements, 1500.0, delta_tof_s=np.zeros((8, 8)))
    for method in methods():
        if "opencl" not in method:
            reconstruct_here(
                water, Settings.from_values(method="sart", eikonal=method, nodes=16, iterations=1)
            )
    reconstruct_here(water, Settings(method="sart", rays="straight", nodes=16, iterations=1))


def warm_up_rendering() -> None:
    """Draw a small ball with the default filter, refracted and shaded; other filters compile on demand."""
    filtered = filter_volume(Volume.from_values(sampled(ONE_HOLE, 8), (1e-3,) * 3), RefractionView())
    for mode in ("refract", "shaded"):
        view = RefractionView(iso=(0.5,), mode=mode, width=4, height=4)
        draw_tile(build_scene(filtered, view.layers()), view, 0, 4)


def warm_up_tracing() -> None:
    """Trace a ball with a geometry field; the layout of meshes compiles on demand."""
    mesh = sphere(4, 5).in_unit_cube()
    surface = surface_of(Chart(mesh, mesh.corners[..., :2]))
    points, starts = spread_points(surface, 2)
    outer = outer_field(4, [build_rows(surface, 4, 0, 96)])
    inner = inner_field(4, starts, [build_inner_rows(surface, 4, points)])
    view = FieldView(scene="mirror-ball", up="z", width=4, height=4)
    scene = scene_of(Shape(surface, outer, inner), None, view)
    trace(world_of(scene), camera_of(view), TraceSettings(view.height, view.width))


def compile_rays(folder: Path) -> None:
    """Reconstruct from travel times and amplitudes; ``folder`` is for files."""
    warm_up()
    for number, (scan, settings) in enumerate(
        (
            (simulate(TIMES), time_settings()),
            (simulate(HEIGHTS), slice_settings()),
            (simulate(SPACE), slice_settings()),
        )
    ):
        _reconstruct(folder / f"times-{number}.h5", scan, settings)


def compile_traces(folder: Path) -> None:
    """Reconstruct from simulated waves, after ``compile_rays`` in the same process."""
    waves = simulate(WAVES)
    for number, scan in enumerate((waves, digitised(waves))):
        _reconstruct(folder / f"traces-{number}.h5", scan, trace_settings())


def compile_waves(_folder: Path) -> None:
    """Simulate waves in two and three dimensions."""
    simulate(WAVES)
    simulate_emission(WAVES_IN_SPACE, 0)


def compile_field(folder: Path) -> None:
    """Compute a geometry field of a mesh, and trace rays through it."""
    warm_up_tracing()
    mesh, work = folder / "mesh.h5", folder / "field-work"
    write_mesh(mesh, StoredMesh(bumpy_ball(320)))
    work.mkdir()
    settings = FieldSettings(samples=4, inner_samples=4, divisions=4, image_size=33)
    geometry_field.build_field(None, mesh, settings, folder / "field", work)
    field_picture.picture_png(folder / "field", FieldView(lookup="uv-linear", width=4, height=4))


def compile_filter(name: str, _folder: Path) -> None:
    """Render a ball with a filter, refracted and shaded, with all kinds of supersampling."""
    warm_up_rendering()
    volume = Volume.from_values(sampled(ONE_HOLE, 12), (1e-3,) * 3)
    filtered = filter_volume(volume, RefractionView(filter=name))
    for view in (
        RefractionView(iso=(0.5,), supersampling="prss", degree=2, width=8, height=8),
        RefractionView(iso=(0.5,), supersampling="real", degree=2, width=8, height=8),
        RefractionView(iso=(0.5,), ray_spacing=2, width=8, height=8),
        RefractionView(iso=(0.5,), mode="shaded", supersampling="none", width=8, height=8),
    ):
        chosen = replace(view, filter=name)
        draw_tile(build_scene(filtered, chosen.layers()), chosen, 0, 8)


# Side by side in two processes, the longest first. Parts in one tuple follow each other in one process, as
# traces need the kernels of rays; those of waves are compiled by then.
PARTS: tuple[tuple[Callable[[Path], None], ...], ...] = (
    (compile_rays, compile_traces),
    (compile_waves, compile_field),
    *((partial(compile_filter, name),) for name in FILTERS),
)


def _reconstruct(path: Path, scan: Dataset, candidates: Iterator[dict[str, Any]]) -> None:
    write_dataset(path, scan)
    quality.quality_report(path, "aic")
    for settings in candidates:
        reconstruct(
            None,
            path,
            Settings.from_values(**{"method": "sart", "nodes": NODES, "iterations": 1, **settings}),
        )


def compiled_in(programs: tuple[Callable[[Path], None], ...], folder: Path) -> int:
    """How many kernels these parts have compiled, in a process of its own."""
    warnings.simplefilter("ignore")
    with compiled_kernels() as kernels:
        for program in programs:
            program(folder)
    return len(kernels)


def marker() -> Path:
    """The file that says that all is compiled, beside what was: named for sources and processor."""
    key = hashlib.sha256(Path(__file__).read_bytes())
    processor = binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()
    for text in (digest(__name__), sys.version, *processor):
        key.update(text.encode())
    folder = os.environ.get("NUMBA_CACHE_DIR") or ROOT / "__pycache__"
    return Path(folder) / f"compiled-{key.hexdigest()[:16]}"


def main() -> None:
    """Compile all parts in two processes side by side, as compilation uses one core."""
    done = marker()
    if done.exists():
        sys.stdout.write("All kernels are compiled already\n")
        return
    with (
        tempfile.TemporaryDirectory() as name,
        ProcessPoolExecutor(2, get_context("spawn")) as processes,
    ):
        running = [processes.submit(compiled_in, programs, Path(name)) for programs in PARTS]
        total = sum(future.result() for future in running)
    done.parent.mkdir(parents=True, exist_ok=True)
    done.touch()
    sys.stdout.write(f"{total} kernels compiled\n")


if __name__ == "__main__":
    main()

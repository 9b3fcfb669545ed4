"""Worker preload: compile (or load from the cache) the kernels before the first task needs them."""

from __future__ import annotations

import fcntl
import hashlib
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

import bentray_kernels
from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.eikonal import methods
from bentray_kernels.geometry_field.tables.inner_field import build_inner_rows, inner_field, spread_points
from bentray_kernels.geometry_field.tables.outer_field import build_rows, outer_field
from bentray_kernels.geometry_field.tracing.packed_scene import world_of
from bentray_kernels.geometry_field.tracing.ray_tracer import TraceSettings, trace
from bentray_kernels.geometry_field.tracing.scene import Shape
from bentray_kernels.meshes.example_surfaces import sphere
from bentray_kernels.meshes.mesh import Chart
from bentray_kernels.meshes.surface import surface_of
from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_kernels.tomography import Settings, reconstruct

from ..cluster import memory_cache, refusal_log
from ..cluster.worker_health import COMPILING
from ..files.volume import Volume
from ..rendering.field_scenes import camera_of, scene_of
from ..rendering.field_view import FieldView
from ..rendering.refraction import draw_tile
from ..rendering.refraction_view import RefractionView
from ..rendering.scene_cache import build_scene, filter_volume
from . import cache_misses


def warm_up() -> None:
    """Reconstruct eight elements in water with every solver but OpenCL and with both kinds of ray.

    OpenCL devices are tested on demand: a test takes seconds, and few jobs need one.
    """
    elements = np.arange(8)
    water = Dataset(Ring(8, 0.01).positions(), elements, elements, 1500.0, delta_tof_s=np.zeros((8, 8)))
    for method in methods():
        if "opencl" not in method:
            reconstruct(water, Settings.from_values(method="sart", eikonal=method, nodes=16, iterations=1))
    reconstruct(water, Settings(method="sart", rays="straight", nodes=16, iterations=1))


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
    view = FieldView(scene="mirror-ball", width=4, height=4)
    scene = scene_of(Shape(surface, outer, inner), None, view)
    trace(world_of(scene), camera_of(view), TraceSettings(view.height, view.width))


def dask_setup(worker: Any) -> None:
    """Called by Dask in each worker that preloads this module."""
    refusal_log.install()
    compiling = cache_misses.announce()
    worker.metrics[COMPILING] = lambda _: compiling()
    if worker.nanny is not None:
        # A separate process: its files are readable by its user only.
        os.umask(0o077)
        memory_cache.set_memory_limit(int(worker.memory_manager.memory_limit or 0))
    with _one_at_a_time():
        warm_up()
        warm_up_rendering()
        warm_up_tracing()


@contextmanager
def _one_at_a_time() -> Iterator[None]:
    """The first worker of an installation compiles for minutes; the others then load its cache."""
    # Folder of the cached kernels: named by the environment, else that of their sources.
    cache = os.environ.get("NUMBA_CACHE_DIR") or str(Path(bentray_kernels.__file__).parent)
    name = f"bentray-warm-up-{os.getuid()}-{hashlib.sha256(cache.encode()).hexdigest()[:16]}.lock"
    with (Path(tempfile.gettempdir()) / name).open("ab") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield

"""Worker preload: compile (or load from the cache) the kernels before the first task needs them."""

from __future__ import annotations

from typing import Any

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation import Ring
from bentray_kernels.eikonal import methods
from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_kernels.tomography import Settings, reconstruct

from . import refusal_log
from .refraction import strip
from .refraction_view import RefractionView
from .scene_cache import build, filtered_of
from .volume_file import Volume


def warm_up() -> None:
    """Reconstruct eight elements in water with every solver but OpenCL and with both kinds of ray.

    OpenCL devices are tried when first asked for: a trial takes seconds, and few jobs want one.
    """
    elements = np.arange(8)
    water = Dataset(Ring(8, 0.01).positions(), elements, elements, 1500.0, delta_tof_s=np.zeros((8, 8)))
    for method in methods():
        if "opencl" not in method:
            reconstruct(water, Settings(eikonal=method, nodes=16, sweeps=1))
    reconstruct(water, Settings(rays="straight", nodes=16, sweeps=1))


def warm_up_rendering() -> None:
    """Draw a small ball through the default filter, refracted and shaded; other filters wait."""
    filtered = filtered_of(Volume.of(sampled(ONE_HOLE, 8), (1e-3,) * 3), "bspline3", 0.0)
    for mode in ("refract", "shaded"):
        view = RefractionView(iso=(0.5,), mode=mode, width=4, height=4)
        strip(build(filtered, view.layers()), view, 0, 4)


def dask_setup(worker: Any) -> None:
    """Called by Dask in each worker that preloads this module."""
    refusal_log.install()
    warm_up()
    warm_up_rendering()

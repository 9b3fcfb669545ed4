"""Worker preload: compile (or load from the cache) the kernels before the first task needs them."""

from __future__ import annotations

from typing import Any

import numpy as np

from bentray_kernels.eikonal import methods, solve
from bentray_kernels.rays import trace


def warm_up() -> None:
    """Run every solver and both kinds of ray once, on a tiny grid."""
    speed = np.full((8, 8), 1500.0)
    for method in methods():
        tof = solve(speed, 1e-3, (1e-3, 1e-3), method)
    for kind in ("curved", "straight"):
        trace(tof, 1e-3, [[6e-3, 6e-3]], (1e-3, 1e-3), kind=kind)


def dask_setup(worker: Any) -> None:
    """Called by Dask in each worker that preloads this module."""
    warm_up()

"""Figures 25 to 27 of the dissertation on our meshes, and the pixels changed by fields."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from bentray_kernels.geometry_field.tracing.packed_scene import world_of
from bentray_kernels.geometry_field.tracing.ray_tracer import TraceSettings, trace
from bentray_kernels.geometry_field.tracing.scene import Scene
from bentray_kernels.refraction import Camera
from bentray_kernels.refraction.supersampling import averaged
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step
from bentray_workers.files.atomic import write_bytes

from ..shared._contact_sheet import Panel, sheet
from ._geometry_scenes import SCENES, glass, self_reflection
from ._lookup_figure import lookup_panels

PICTURE = Path(__file__).parents[1] / "results" / "chapter5.png"
THREADS = len(os.sched_getaffinity(0))

# Share of pixels that fields may change, %; refraction doubles what a surface is off.
ODD = {"body refracting twice": 3.0}


def rows(quick: bool, progress: Step) -> Iterable[Row]:
    """Pixels that fields change, scene by scene; and the sheet of all figures."""
    pixels = 176 if quick else 352
    panels: dict[str, Panel] = {}
    for k, (name, make) in enumerate(SCENES.items()):
        progress(k, len(SCENES), name)
        scene, camera = make()
        seconds, image = drawn(scene, camera, pixels)
        _, exact = drawn(scene, camera, pixels, "exact")
        panels[name] = Panel(f"{name}\n{1e3 * seconds:.0f} ms", image)
        off = np.abs(image.astype(int) - exact).max(axis=2) > 8
        detail = "pixels of the averaged picture off by more than 8 of 255 against no fields at all"
        yield Row(f"Figure 26, 27: {name}", 100.0 * off.mean(), ODD.get(name, 1.0), "<=", "%", detail)
    if quick:
        return
    more = {
        "ball refracting once": glass("ball", "single"),
        "body refracting once": glass("body", "single"),
        "no self-reflection": self_reflection(False, False),
        "self-reflection alone": self_reflection(True, False),
        "others alone": self_reflection(False, True),
    }
    panels |= {name: Panel(name, drawn(*scene, pixels)[1]) for name, scene in more.items()}
    groups = {
        "Figure 26: bodies in mirrors": list(SCENES)[:4],
        "Figure 27: refraction": [name for name in panels if "refracting" in name],
        "Figure 27: self-reflection": [*list(more)[2:], "self-reflection and others"],
    }
    found = [(title, [panels[name] for name in names]) for title, names in groups.items()]
    write_bytes(PICTURE, sheet([("Figure 25: ways to look up", lookup_panels(pixels)), *found], 256))


def drawn(scene: Scene, camera: Camera, pixels: int, way: str = "walk") -> tuple[float, np.ndarray]:
    """Seconds, and the picture of four rays a pixel."""
    world = world_of(scene)
    start = time.perf_counter()
    image = trace(world, camera, TraceSettings(2 * pixels, 2 * pixels, way=way, threads=THREADS))
    return time.perf_counter() - start, averaged(image, 2)

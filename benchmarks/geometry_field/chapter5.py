"""Figures 25 to 27 of the dissertation on our meshes, and the pixels changed by fields."""

import os
import time
from collections.abc import Iterable

import numpy as np

from bentray_kernels.geometry_field.image.geometry_image import geometry_image
from bentray_kernels.geometry_field.layout.parameterisation import parameterise
from bentray_kernels.geometry_field.tracing.packed_scene import world_of
from bentray_kernels.geometry_field.tracing.ray_tracer import TraceSettings, trace
from bentray_kernels.geometry_field.tracing.scene import Scene
from bentray_kernels.refraction import Camera, perspective
from bentray_kernels.refraction.supersampling import averaged
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

from ..shared._pictures import Panel, sheet
from ._field_lookups import PIXELS, SAMPLES, Lookups, between_pixels
from ._field_rays import load_mesh
from ._geometry_scenes import SCENES, glass, self_reflection
from ._inner_lookups import inner_rows

# Of Figure 25.
EYE, LIGHT = (0.75, 0.75, 2.2), np.array([0.4, 0.5, 0.75])
CLAY, SKY = np.array([0.85, 0.66, 0.5]), np.array([0.85, 0.9, 0.97])

NAMES = {
    "nearest uv": "nearest (u, v), as published",
    "linear uv": "4-D linear (u, v), as published",
    "walk": "walk from the nearest entry's\nface, as we do",
}

# Of the pictures.
COLOURS = 256
THREADS = len(os.sched_getaffinity(0))

# Share of pixels that fields may change, %; refraction doubles what a surface is off.
ODD = {"body refracting twice": 3.0}


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Pixels that fields change, scene by scene, rays that leave a surface, and Figures 25 to 27."""
    pixels = 176 if context.quick else 352
    panels: dict[str, Panel] = {}
    for k, (name, make) in enumerate(SCENES.items()):
        context.progress(k, len(SCENES), name)
        scene, camera = make()
        seconds, image = drawn(scene, camera, pixels)
        _, exact = drawn(scene, camera, pixels, "exact")
        panels[name] = Panel(f"{name}\n{1e3 * seconds:.0f} ms", image)
        off = np.abs(image.astype(int) - exact).max(axis=2) > 8
        detail = "pixels of the averaged picture off by more than 8 of 255 against no fields at all"
        yield Row(f"Figure 26, 27: {name}", 100.0 * off.mean(), ODD.get(name, 1.0), "<=", "%", detail)
    context.progress(len(SCENES), len(SCENES), "the published inner field")
    yield from inner_rows(context.quick)
    lookups = "Figure 25: ways to look up"
    context.save_picture("figure25.png", lambda: sheet([(lookups, lookup_panels(pixels))], COLOURS))
    mirrors = [panels[name] for name in list(SCENES)[:4]]
    context.save_picture("figure26.png", lambda: sheet([("Figure 26: bodies in mirrors", mirrors)], COLOURS))
    context.save_picture("figure27.png", lambda: figure27(panels, pixels))


def figure27(scenes: dict[str, Panel], pixels: int) -> bytes:
    """Refraction and self-reflection, in parts and together."""
    more = {
        "ball refracting once": glass("ball", "single"),
        "body refracting once": glass("body", "single"),
        "no self-reflection": self_reflection(False, False),
        "self-reflection alone": self_reflection(True, False),
        "others alone": self_reflection(False, True),
    }
    panels = scenes | {name: Panel(name, drawn(*scene, pixels)[1]) for name, scene in more.items()}
    groups = {
        "Figure 27: refraction": [name for name in panels if "refracting" in name],
        "Figure 27: self-reflection": [*list(more)[2:], "self-reflection and others"],
    }
    return sheet([(title, [panels[name] for name in names]) for title, names in groups.items()], COLOURS)


def drawn(scene: Scene, camera: Camera, pixels: int, way: str = "walk") -> tuple[float, np.ndarray]:
    """Seconds, and the picture of four rays a pixel."""
    world = world_of(scene)
    start = time.perf_counter()
    image = trace(world, camera, TraceSettings(2 * pixels, 2 * pixels, way=way, threads=THREADS))
    return time.perf_counter() - start, averaged(image, 2)


def lookup_panels(pixels: int) -> list[Panel]:
    """The body in clay, by three lookups."""
    chart = parameterise(load_mesh()[1]).chart
    image, lookups = geometry_image(chart, PIXELS), Lookups.from_chart(chart, SAMPLES)
    camera = perspective(EYE, (0.45, 0.5, 0.5), (0.0, 1.0, 0.0), 38.0)
    position = (np.arange(2 * pixels) + 0.5) / (2 * pixels) - 0.5
    u, v = np.tile(position, 2 * pixels)[:, None], np.repeat(position, 2 * pixels)[:, None]
    ahead = camera.direction[0] + u * camera.direction[1] + v * camera.direction[2]
    rays = np.float32(np.broadcast_to(camera.origin[0], ahead.shape)), np.float32(ahead)
    runs, results = lookups.runs(rays)
    panels = []
    for way, words in NAMES.items():
        runs[way]()
        if way.endswith("uv"):
            normals = between_pixels(image, image.normals, results[way])
        else:
            normals = lookups.normals(results["faces"], results["weights"])
        panels.append(Panel(words, shaded(normals, 2 * pixels)))
    return panels


def shaded(normals: np.ndarray, pixels: int) -> np.ndarray:
    """Clay under a light, half as many pixels along each side; NaN is sky."""
    light = LIGHT / np.linalg.norm(LIGHT)
    with np.errstate(invalid="ignore"):
        shown = 0.25 + 0.75 * np.clip(normals @ light / np.linalg.norm(normals, axis=1), 0.0, 1.0)
    colours = np.where(np.isfinite(shown)[:, None], shown[:, None] * CLAY, SKY)
    return averaged(np.uint8(255.0 * colours.reshape(pixels, pixels, 3) + 0.5), 2)

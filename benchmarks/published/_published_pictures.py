"""Pictures by the published lookups and before warped backdrops, beside ours."""

import time
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from bentray_kernels.geometry_field.image.geometry_image import geometry_image
from bentray_kernels.geometry_field.layout.parameterisation import parameterise
from bentray_kernels.geometry_field.tables.reference_field import reference_field
from bentray_kernels.geometry_field.tracing.packed_scene import world_of
from bentray_kernels.geometry_field.tracing.ray_tracer import TraceSettings, trace
from bentray_kernels.geometry_field.tracing.scene import Instance, Material, Scene, Shape, placed
from bentray_kernels.meshes.example_surfaces import bumpy_ball
from bentray_kernels.meshes.surface import surface_of
from bentray_kernels.refraction import (
    Backdrop,
    RenderSettings,
    backdrop_of,
    checkerboard,
    perspective,
    render,
)
from bentray_service.cli.output.benchmark_row import Row

from ..geometry_field._field_rays import build_outer_field
from ..geometry_field._geometry_scenes import landscape
from ..refraction._glass import BEHIND, DOWN, FRONT, RIGHT, ball, glass, waves
from ..shared._timing import alternate

FACES, SAMPLES, IMAGE = 20_000, 24, 513
SQUARES, SMOOTH = 24, "B-spline 3, smooth λ = 1"


def lookup_rows(quick: bool) -> Iterable[Row]:
    """Pixels that differ from exact intersection, and time, of two mirrors: geometry image and walk."""
    pixels = 128 if quick else 384
    chart = parameterise(bumpy_ball(FACES)).chart
    surface, image = surface_of(chart), geometry_image(chart, IMAGE)
    outer = build_outer_field(surface, SAMPLES)
    started = time.perf_counter()
    reference = reference_field(surface, outer, image.positions, image.normals, image.valid)
    made = time.perf_counter() - started
    shape = Shape(surface, outer, reference=reference)
    instances = tuple(
        Instance(
            shape, placed((x, 0.0, 0.5), 1.0), Material(colour=colour, mirror=0.7, self_reflection=False)
        )
        for x, colour in ((-0.6, (0.9, 0.4, 0.3)), (0.6, (0.3, 0.5, 0.9)))
    )
    world = world_of(Scene(instances, landscape(256)))
    camera = perspective((0.0, -3.4, 1.2), (0.0, 0.0, 0.45), (0.0, 0.0, 1.0), 38.0)

    def picture(way: str) -> np.ndarray:
        return trace(world, camera, TraceSettings(pixels, pixels, way=way, eye=way)).astype(int)

    ways = ("uv-nearest", "uv-linear", "walk")
    exact = picture("exact")
    off = {way: 100.0 * float((np.abs(picture(way) - exact).max(axis=2) > 8).mean()) for way in ways}
    seconds = alternate({way: lambda way=way: picture(way) for way in (*ways, "exact")}, 3)
    listed = ", ".join(f"{way} {1e3 * least:.0f}" for way, least in seconds.items())
    where = f"two bumpy mirrors of {FACES} faces, {pixels}², n = {SAMPLES}, image {IMAGE}²"
    for way in ways[:2]:
        detail = (
            f"off by more than 8 of 255; walk (ours) {off['walk']:.2f} %; {where}; table made in {made:.1f} s"
        )
        yield Row(f"{way} and geometry image, odd pixels", off[way], off["walk"], ">=", "%", detail)
        detail = f"ms a picture, one core: {listed}; {where}"
        yield Row(f"{way} / walk, time", seconds[way] / seconds["walk"], 1.0, ">=", "", detail)


def board(relief: np.ndarray | None) -> Backdrop:
    """The checkerboard of chapter 3, flat or warped."""
    return backdrop_of([replace(checkerboard(BEHIND, RIGHT, DOWN, SQUARES), relief=relief)])


def backdrop_rows(quick: bool) -> Iterable[Row]:
    """Time of a warped backdrop over a flat one, and what supersampling after refraction gains on both."""
    pixels = 96 if quick else 256
    scene = glass(ball(), SMOOTH)
    boards = {"flat": board(None), "warped": board(waves())}

    def picture(backdrop: Backdrop, **how: object) -> np.ndarray:
        settings = RenderSettings(pixels, pixels, seed=None, **how)
        return render(scene, FRONT, backdrop, settings).image.astype(float)

    seconds = alternate({name: lambda board=board: picture(board) for name, board in boards.items()}, 3)
    detail = f"{pixels}², one core: " + ", ".join(f"{name} {1e3 * s:.0f} ms" for name, s in seconds.items())
    ratio = seconds["warped"] / seconds["flat"]
    yield Row("warped / flat backdrop, time", ratio, 2.0, "<=", "", f"{detail}; theirs are flat alone")
    gains = {}
    for name, pattern in boards.items():
        many = picture(pattern, supersampling="real", degree=8)
        error = {
            way: float(np.sqrt(((picture(pattern, supersampling=way) - many) ** 2).mean()))
            for way in ("none", "prss")
        }
        gains[name] = 20.0 * float(np.log10(error["none"] / error["prss"]))
    detail = f"PSNR towards 64 samples, {pixels}²; flat {gains['flat']:.1f} dB"
    yield Row("supersampling after refraction, warped backdrop", gains["warped"], 0.0, ">=", "dB", detail)

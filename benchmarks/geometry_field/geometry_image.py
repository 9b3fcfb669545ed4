"""Parameterisation and geometry images: G5, the first part of G1, and the first columns of Table 5."""

import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bentray_kernels.geometry_field.image.geometry_image import GeometryImage, geometry_image
from bentray_kernels.geometry_field.layout.distortion import signed_areas
from bentray_kernels.geometry_field.layout.parameterisation import Parameterisation, parameterise
from bentray_kernels.meshes.example_surfaces import bumpy_ball, sphere, torus
from bentray_kernels.meshes.geometric_error import geometric_error
from bentray_kernels.meshes.mesh import TriangleMesh
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_workers.files.mesh_formats import read_mesh

from ._geometry_image_picture import picture

BUNNY = Path(__file__).resolve().parents[3] / "shared" / "data" / "bunny.off"

SIZE = 512
REPEATS = 3

# Seconds of Table 5: parameterisation, geometry image. The bunny stands beside the male face, 80,072 faces.
TABLE5 = {"sphere": (15.0, 0.8), "torus": (34.0, 2.2), "bunny": (200.0, 16.0)}

# Right, up and towards the eye.
FRONT = np.eye(3)
ASLANT = np.array([(0.8, 0.6, 0.0), (-0.3, 0.4, 0.866), (0.52, -0.693, 0.5)])


@dataclass(frozen=True)
class Made:
    """Chart and image of a surface, with the least seconds of the clock and of the processor."""

    chart: Parameterisation
    image: GeometryImage
    chart_seconds: float
    image_seconds: float
    chart_busy: float


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """G1's parameterisation and G5 on the bunny, Table 5, with a picture."""
    surfaces: dict[str, TriangleMesh | None] = {"sphere": sphere(), "torus": torus(), "bunny": bunny()}
    surfaces["bumpy ball"] = bumpy_ball(5_000 if context.quick else 75_408)
    # So that nothing is compiled in the time that counts.
    made(bumpy_ball(1_000), 1)
    images = {}
    for k, (name, surface) in enumerate(surfaces.items()):
        context.progress(k, len(surfaces), name)
        if surface is not None:
            images[name] = made(surface, 1 if context.quick else REPEATS)
    for name, theirs in TABLE5.items():
        yield from table5_rows(name, theirs, images.get(name))
    for name, goal in (("bunny", ""), ("bumpy ball", ", bumpy ball")):
        yield from target_rows(goal, images.get(name))
    views = {"sphere": FRONT, "torus": ASLANT, "bunny": FRONT}
    shown = {
        name: (images[name].chart, images[name].image, view) for name, view in views.items() if name in images
    }
    context.save_picture("geometry_image.png", lambda: picture(shown))
    context.progress(len(surfaces), len(surfaces), "done")


def bunny() -> TriangleMesh | None:
    """The mesh, where its file is."""
    return read_mesh(BUNNY.read_bytes()).surface.mesh if BUNNY.exists() else None


def made(surface: TriangleMesh, repeats: int) -> Made:
    """The chart and the image of a surface, least of so many times."""
    chart_seconds, image_seconds, chart_busy = [], [], []
    for _ in range(repeats):
        start, busy = time.perf_counter(), time.process_time()
        chart = parameterise(surface)
        middle = time.perf_counter()
        chart_busy.append(time.process_time() - busy)
        image = geometry_image(chart.chart, SIZE)
        # Both maps are made when they are first asked for.
        assert image.positions.shape == image.normals.shape
        chart_seconds.append(middle - start)
        image_seconds.append(time.perf_counter() - middle)
    return Made(chart, image, min(chart_seconds), min(image_seconds), min(chart_busy))


def table5_rows(name: str, theirs: tuple[float, float], made: Made | None) -> Iterable[Row]:
    """Seconds beside the dissertation's."""
    for step, seconds, goal in (
        ("parameterisation", made and made.chart_seconds, theirs[0]),
        ("geometry image", made and made.image_seconds, theirs[1]),
    ):
        detail = absent() if made is None else f"{faces(made)}; theirs {goal:g} s"
        yield Row(f"Table 5 {name}, {step}", seconds, goal, "<=", "s", detail)


def target_rows(label: str, made: Made | None) -> Iterable[Row]:
    """G1's parameterisation and G5 of one surface."""
    goals = {
        f"G1 parameterisation{label}": (3.0, "<=", "s"),
        f"G5 rms{label}": (3.2e-4, "<=", "of the cube"),
        f"G5 flipped triangles{label}": (0.0, "==", ""),
        f"G5 median quasi-conformal factor{label}": (1.02, "<=", ""),
    }
    values: list[float | None] = [None] * len(goals)
    details = [absent()] * len(goals)
    if made is not None:
        mesh, uv = made.chart.chart.mesh, made.chart.chart.uv
        error = geometric_error(mesh, made.image.mesh())
        factors = made.chart.quasi_conformal
        values = [
            made.chart_seconds,
            error.rms,
            float((signed_areas(uv) <= 0.0).sum()),
            float(np.median(factors)),
        ]
        details = [
            f"{faces(made)}, one thread, {made.chart_busy:.1f} s of processor time; least of the runs",
            f"{SIZE}², both ways; largest distance {error.greatest:.1e}",
            f"area stretch {made.chart.area_stretch:.2f}, {signed_areas(uv).sum():.0%} of the square filled",
            f"99 of 100 below {np.quantile(factors, 0.99):.3f}, largest {factors.max():.2f}",
        ]
    for (name, (goal, op, unit)), value, detail in zip(goals.items(), values, details, strict=True):
        yield Row(name, value, goal, op, unit, detail)


def faces(made: Made) -> str:
    return f"{len(made.chart.quasi_conformal):,} faces"


def absent() -> str:
    return f"{BUNNY.name} is not in ../shared/data"

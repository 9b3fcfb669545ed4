"""Table 5 of the dissertation, whole: seconds of each step of a geometry field, theirs beside ours."""

import os
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from bentray_kernels.meshes.example_surfaces import bumpy_ball, sphere, torus
from bentray_kernels.meshes.mesh import TriangleMesh
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_workers.files.mesh import StoredMesh, write_mesh
from bentray_workers.rendering.field_settings import FieldSettings
from bentray_workers.rendering.geometry_field import build_field


class PublishedTimes(NamedTuple):
    """A row of Table 5: a single 3.6 GHz processor; the last column one field of 24² · 6 samples."""

    surface: str
    faces: int
    parameterisation: float
    image: float
    field: float


TABLE = (
    PublishedTimes("sphere", 1_922, 15.0, 0.8, 420.0),
    PublishedTimes("torus", 7_938, 34.0, 2.2, 420.0),
    PublishedTimes("female face", 50_000, 130.0, 9.5, 432.0),
    PublishedTimes("male face", 80_072, 200.0, 16.0, 504.0),
    PublishedTimes("David head", 101_144, 250.0, 20.0, 672.0),
)
SETTINGS = FieldSettings(samples=24, image_size=513)


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Three rows a surface, and the whole from a mesh file to a field on disk; quick: the small ones."""
    shown = TABLE[: 2 if context.quick else len(TABLE)]
    # So that nothing is compiled in the time that counts.
    made(bumpy_ball(500), FieldSettings(samples=4, inner_samples=4, image_size=33))
    for number, theirs in enumerate(shown):
        context.progress(number, len(shown), theirs.surface)
        yield from rows_of(theirs)
    context.progress(len(shown), len(shown), "done")


def rows_of(theirs: PublishedTimes) -> Iterable[Row]:
    """Rows of one surface; a bumpy ball of as many faces stands for the heads, which are not ours to give."""
    mesh = {"sphere": sphere, "torus": torus}.get(theirs.surface, lambda: bumpy_ball(theirs.faces))()
    figures, whole = made(mesh, SETTINGS)
    what = f"{figures['faces']:,} faces" + ("" if len(mesh.faces) <= 7_938 else ", a bumpy ball")
    cores = len(os.sched_getaffinity(0))
    for column, seconds, goal in (
        ("parameterisation", figures["parameterisation_seconds"], theirs.parameterisation),
        ("geometry image", figures["image_seconds"], theirs.image),
        ("geometry field", figures["outer_seconds"], theirs.field),
    ):
        detail = f"{what}; theirs {goal:g} s, {goal / seconds:.0f} times ours, added up over threads"
        yield Row(f"Table 5 {theirs.surface}, {column}", seconds, goal, "<=", "s", detail)
    total = theirs.parameterisation + theirs.image + theirs.field
    detail = f"{what}, {cores} threads, with the inner field, from a mesh file to files; theirs {total:g} s"
    yield Row(f"Table 5 {theirs.surface}, whole", whole, total, "<=", "s", detail)


def made(mesh: TriangleMesh, settings: FieldSettings) -> tuple[dict[str, float], float]:
    """The figures of a field, and the seconds until it was there."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "work").mkdir()
        write_mesh(folder / "mesh.h5", StoredMesh(mesh))
        started = time.perf_counter()
        figures = build_field(None, folder / "mesh.h5", settings, folder / "field", folder / "work")
        return figures, time.perf_counter() - started

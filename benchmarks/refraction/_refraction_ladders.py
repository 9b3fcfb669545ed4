"""Tables 2, 3 and 4 of the dissertation: candidate cells and frame times, theirs and ours."""

import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bentray_kernels.isosurface import cell_ranges
from bentray_kernels.refraction import (
    Backdrop,
    Camera,
    Layers,
    RenderSettings,
    Scene,
    backdrop_of,
    checkerboard,
    orthographic,
    render,
)
from bentray_kernels.splines import Spline
from bentray_service.cli.output.benchmark_row import Row

from ..shared._timing import alternate
from ._refracting_ball import RIM_RADIUS, WIDTH, board, camera, eight_bit

# Not part of the project: lies beside a checkout where somebody has put it.
TEAPOT = Path(__file__).parents[3] / "shared" / "data" / "teapot_178x256x256.npz"


# Searches of table 2, and filters of table 4.
TABLE2 = ("steps", "bmcc dda", "bmcc octree", "accc dda", "accc octree")
TABLE4 = ("trilinear", "catmull-rom", "bspline2", "bspline3", "bspline6")


@dataclass(frozen=True)
class Subject:
    """A volume and how it is looked at.

    Attributes:
        name: for the rows.
        size: what the dissertation leaves open, or not.
        volume: (nx, ny, nz), 8-bit values.
        iso: of its surface.
        camera, backdrop: in units of the distance between nodes.
        cells: of table 3, ACCC over BMCC, for B-splines 2 and 3.
        table2: published seconds in the order of ``TABLE2``.
        table4: published seconds in the order of ``TABLE4``, with DDA and with octree.
    """

    name: str
    size: str
    volume: np.ndarray
    iso: float
    camera: Camera
    backdrop: Backdrop
    cells: dict[int, float]
    table2: tuple[float, ...]
    table4: tuple[tuple[float, ...], tuple[float, ...]]

    def gain(self, search: str) -> float:
        """Published time by steps over that of another search."""
        return self.table2[0] / self.table2[TABLE2.index(search)]


def subjects() -> list[Subject]:
    """The ball, and the teapot where its volume is at hand."""
    ball = Subject(
        "sphere",
        f"surface at {RIM_RADIUS:.1f} of 31.5 nodes, theirs not told",
        eight_bit(),
        127.5,
        camera(),
        board(),
        {2: 0.671, 3: 0.375},
        (6.65, 0.84, 0.29, 0.69, 0.15),
        ((0.93, 1.79, 0.67, 0.69, 0.89), (0.09, 0.42, 0.14, 0.15, 0.34)),
    )
    if not TEAPOT.is_file():
        return [ball]
    volume = np.load(TEAPOT)["volume"].astype(float)
    looking = orthographic((-200.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), 4.0 * WIDTH)
    behind = backdrop_of([checkerboard((300.0, 0.0, 0.0), (0.0, 0.0, 256.0), (0.0, 256.0, 0.0), 16)])
    teapot = Subject(
        "teapot",
        "axial axis first",
        volume,
        20.5,
        looking,
        behind,
        {2: 0.771, 3: 0.514},
        (287.43, 41.61, 17.71, 12.16, 2.42),
        ((30.26, 34.92, 8.23, 12.16, 21.99), (1.96, 5.91, 2.22, 2.42, 3.99)),
    )
    return [ball, teapot]


def cells(subject: Subject) -> Iterable[Row]:
    """Table 3, and how many cells the Bernstein hull leaves."""
    for order, theirs in subject.cells.items():
        spline = Spline(subject.volume, order)
        # The exact range takes minutes in a large volume.
        bounds = ("bmcc", "accc", "bernstein", "ccc")[: 4 if subject.volume.size < 1e6 else 3]
        ranges_of = {bound: cell_ranges(spline, [subject.iso], bound) for bound in bounds}
        count = {bound: ranges.candidates(subject.iso) for bound, ranges in ranges_of.items()}
        detail = ", ".join(f"{bound} {number}" for bound, number in count.items())
        ours = count["accc"] / count["bmcc"]
        yield Row(
            f"V4 {subject.name}, order {order}, off theirs",
            abs(ours - theirs) * 100.0,
            5.0,
            "<=",
            "% points",
            f"ACCC/BMCC {ours:.1%}, theirs {theirs:.1%}; {subject.size}; cells: {detail}",
        )
        hull = count["bernstein"] / count["accc"]
        yield Row(f"V4 {subject.name}, order {order}, hull/ACCC", hull, 0.55, "<=", "", f"cells: {detail}")
        surface = holding_corners(subject)
        lost = sum(
            int((surface & ~((ranges.low <= subject.iso) & (ranges.high >= subject.iso))).sum())
            for ranges in ranges_of.values()
        )
        detail = f"of {int(surface.sum())} cells with corners on both sides of the iso-value, by any bound"
        yield Row(f"V4 {subject.name}, order {order}, lost", lost, 0, "==", "cells", detail)


def holding_corners(subject: Subject) -> np.ndarray:
    """Cells that surely hold the surface of a spline through the nodes."""
    above = subject.volume > subject.iso
    for axis in range(3):
        first, last = (np.take(above, range(k, above.shape[axis] - 1 + k), axis=axis) for k in (0, 1))
        above = first + last if axis else first.astype(np.int8) + last
    return (above > 0) & (above < 8)


def ladder(subject: Subject, repeats: int) -> Iterable[Row]:
    """Table 2: steps of 0.1 (with Brent's method), DDA, octree; three bounds; one thread, PRSS."""
    spline = Spline(subject.volume, smoothing=1.0)
    scenes = {
        bound: Scene.build(spline, Layers((subject.iso,), (1.0, 1.5)), bound=bound)
        for bound in ("bmcc", "accc", "bernstein")
    }

    def frame(bound: str, structure: str):
        settings = RenderSettings(structure=structure, roots="certain")
        return lambda: render(scenes[bound], subject.camera, subject.backdrop, settings)

    runs = {f"{b} {s}": frame(b, s) for b in scenes for s in ("dda", "octree")}
    seconds = alternate(runs, repeats, time.process_time)
    seconds |= alternate({"steps": frame("accc", "steps")}, min(repeats, 3), time.process_time)
    for name, theirs in zip(TABLE2[1:], subject.table2[1:], strict=True):
        ours, published = seconds["steps"] / seconds[name], subject.gain(name)
        detail = (
            f"{seconds['steps'] * 1e3:.0f} ms over {seconds[name] * 1e3:.1f} ms; theirs "
            f"{subject.table2[0]:g} s over {theirs:g} s, {published:.0f}"
        )
        yield Row(f"V5 {subject.name}, steps / {name}", ours, round(published), ">=", "", detail)
    best = seconds["bernstein octree"]
    detail = f"{best * 1e3:.1f} ms, DDA {seconds['bernstein dda'] * 1e3:.1f} ms, 256² pixels"
    ratio = seconds["accc octree"] / best
    yield Row(f"V5 {subject.name}, ACCC / Bernstein octree", ratio, 1.0, ">=", "", detail)
    detail = "octree, Bernstein hull, PRSS, one thread; the structure is built before"
    yield Row(f"V5 {subject.name}, frame of 256²", best, 0.3, "<=", "s", detail)
    large = RenderSettings(rows=512, columns=512, threads=2)
    scene = scenes["bernstein"]
    frames = {"large": lambda: render(scene, subject.camera, subject.backdrop, large)}
    seconds = alternate(frames, repeats)
    goal = 0.1 if subject.name == "sphere" else 1.0
    yield Row(f"V5 {subject.name}, frame of 512²", seconds["large"], goal, "<=", "s", "the same, two threads")


def filters(subject: Subject, repeats: int) -> Iterable[Row]:
    """Table 4: what the octree saves over the DDA, filter by filter."""
    for name, *theirs in zip(TABLE4, *subject.table4, strict=True):
        made = Scene.build(
            Spline.from_volume(subject.volume, name), Layers((subject.iso,), (1.0, 1.5)), bound="bernstein"
        )
        runs = {
            structure: lambda made=made, structure=structure: render(
                made, subject.camera, subject.backdrop, RenderSettings(structure=structure)
            )
            for structure in ("dda", "octree")
        }
        seconds = alternate(runs, repeats, time.process_time)
        saved, published = (1.0 - octree / dda for dda, octree in (seconds.values(), theirs))
        detail = (
            f"DDA {seconds['dda'] * 1e3:.1f} ms, octree {seconds['octree'] * 1e3:.1f} ms; "
            f"theirs {theirs[0]:g} s and {theirs[1]:g} s, saved {published:.0%}"
        )
        yield Row(f"V5 {subject.name}, octree saves, {name}", saved, round(published, 2), ">=", "", detail)

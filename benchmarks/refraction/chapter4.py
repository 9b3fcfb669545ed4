"""Goals V4 and V5: Tables 1 to 4 of the dissertation, two volumes made here, and Figures 17 to 22."""

import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from bentray_kernels.refraction import (
    Backdrop,
    Scene,
    backdrop_of,
    checkerboard,
    orthographic,
    perspective,
)
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

from ..shared._pictures import Panel, sheet
from ..shared._timing import alternate
from ._glass import BEHIND, DOWN, REPEATS, RIGHT, ball, breast, drawn, glass, hills, waves
from ._octree_counts import rows as operation_rows
from ._refraction_ladders import cells, filters, ladder, subjects
from ._stand_ins import ISO, stand_ins

SMOOTH = "B-spline 3, smooth λ = 1"

# Frames with and without supersampling after refraction, which differ by a few percent.
MANY_REPEATS = 100

# Seconds of Table 1: without supersampling, with four rays a pixel, after refraction.
TABLE1 = {"Catmull-Rom": (7.63, 28.02, 7.72), SMOOTH: (6.65, 26.83, 6.71)}
WAYS = {"none": ("one ray a pixel", 1), "real": ("four rays a pixel", 2), "prss": ("after refraction", 1)}

# Of whole volumes.
WIDER = orthographic((0.0, 0.0, -3.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), 2.3)

# Renders a scene; takes the backdrop and the camera of ``drawn``.
Draw = Callable[..., np.ndarray]

# m/s: where the fat of the breast begins, and its tissue.
FAT, TISSUE = 1420.0, 1490.0


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Table 1: cost of each way to supersample over none; Tables 2 to 4; Figures 17 to 22.

    The quick run has Tables 2 and 3 of the sphere alone.
    """
    pixels = 96 if context.quick else 352
    panels17 = []
    for name, theirs in TABLE1.items():
        context.progress(len(panels17), 2 * len(WAYS), name)
        scene = glass(ball(), name)
        runs = {
            way: lambda way=way, degree=degree, scene=scene: drawn(
                scene, way, degree=degree, pixels=pixels, repeats=1
            )
            for way, (_, degree) in WAYS.items()
        }
        # In turn, so that the load of the machine meets all ways alike.
        seconds = alternate(
            {way: runs[way] for way in ("none", "prss")},
            5 if context.quick else MANY_REPEATS,
            time.process_time,
        )
        seconds |= alternate({"real": runs["real"]}, 3 * REPEATS, time.process_time)
        for way, (words, degree) in WAYS.items():
            image, _ = drawn(scene, way, degree=degree, pixels=pixels, repeats=1)
            panels17.append(Panel(f"{name}\n{words}, {1e3 * seconds[way]:.0f} ms", image))
        for way, of_theirs in (("real", theirs[1]), ("prss", theirs[2])):
            extra, their_extra = seconds[way] / seconds["none"], of_theirs / theirs[0]
            ours = f"{1e3 * seconds[way]:.0f} over {1e3 * seconds['none']:.0f} ms of processor time"
            detail = f"{ours}; theirs {their_extra:.2f}"
            label = f"Table 1 {WAYS[way][0]} / one ray, {name}"
            yield Row(label, extra, 1.05 if way == "prss" else 5.0, "<=", "", detail)
    title = "Figure 17: two filters, three ways to sample"
    context.save_picture("figure17.png", lambda: sheet([(title, panels17)]))
    volumes = subjects()[:1] if context.quick else [*subjects(), *stand_ins()]
    for k, subject in enumerate(volumes):
        context.progress(k, len(volumes), subject.name)
        yield from cells(subject)
        yield from ladder(subject, 5)
        yield from operation_rows(subject)
        if not context.quick:
            yield from filters(subject, 5)
    for k, (name, (title, panels)) in enumerate(FIGURES.items()):
        context.progress(k, len(FIGURES), title)
        context.save_picture(
            name, lambda title=title, panels=panels: sheet([(title, panels(partial(frame, pixels)))])
        )


def frame(pixels: int, scene: Scene, **how: Any) -> np.ndarray:
    """A picture of a scene, drawn once."""
    return drawn(scene, pixels=pixels, repeats=1, **how)[0]


def holes_and_backdrops(draw: Draw) -> list[Panel]:
    """Balls with holes of air, and one before other backdrops."""
    holes = ("no hole", "one hole", "two")
    panels = [Panel(words, draw(glass(ball(n), SMOOTH))) for n, words in enumerate(holes)]
    for words, behind in backdrops().items():
        panels.append(Panel(words, draw(glass(ball(2), SMOOTH), backdrop=behind)))
    wavy = backdrop_of([replace(checkerboard(BEHIND, RIGHT, DOWN, 24), relief=4.0 * waves())])
    eye = perspective((0.0, 0.0, -3.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 32.0)
    warped = draw(glass(ball(1), SMOOTH), backdrop=wavy, camera=eye)
    return [*panels, Panel("a warped checkerboard", warped)]


def layers(draw: Draw) -> list[Panel]:
    """A core and a shell of different index, and holes in them."""
    cases = {
        "core 1.2, shell 1.5": (0, (1.0, 1.5, 1.2)),
        "core 1.8, shell 1.2": (0, (1.0, 1.2, 1.8)),
        "hole, shell 1.3, core 1.5": (1, (1.0, 1.3, 1.5)),
        "two holes, the same": (2, (1.0, 1.3, 1.5)),
    }
    return [
        Panel(words, draw(glass(ball(holes), SMOOTH, (60.0, 200.0), indices)))
        for words, (holes, indices) in cases.items()
    ]


def breasts(draw: Draw) -> list[Panel]:
    """The sound speed of a breast as glass, by four filters."""
    return [
        Panel(name, draw(glass(breast(), name, (FAT, TISSUE), (1.0, 1.15, 1.4))))
        for name in ("central difference", "Catmull-Rom", "B-spline 3", SMOOTH)
    ]


def replaced(draw: Draw) -> list[Panel]:
    """The volumes that replace the published head and lobster, by two filters."""
    head, lobster = (subject.volume for subject in stand_ins())
    # Along z.
    upright = {"head": head.transpose(0, 2, 1), "lobster": lobster[:, ::-1]}
    return [
        Panel(f"{what}, {name}", draw(glass(volume, name, (ISO,), (1.0, 1.2)), camera=WIDER))
        for what, volume in upright.items()
        for name in ("central difference", SMOOTH)
    ]


def landscapes(draw: Draw) -> list[Panel]:
    """Volumes before a landscape."""
    scenes = {
        "ball": glass(ball(), SMOOTH),
        "ball with a hole": glass(ball(1), SMOOTH),
        "breast": glass(breast(), SMOOTH, (FAT, TISSUE), (1.0, 1.15, 1.4)),
        "ball with two holes": glass(ball(2), SMOOTH),
    }
    return [Panel(words, draw(scene, backdrop=backdrop_of([hills()]))) for words, scene in scenes.items()]


# File, title and panels of each figure after Figure 17.
FIGURES: dict[str, tuple[str, Callable[[Draw], list[Panel]]]] = {
    "figure18.png": ("Figure 18: holes of air, and other backdrops", holes_and_backdrops),
    "figure19.png": ("Figure 19: layers of different index", layers),
    "figure20.png": ("Figure 20: a breast of sound speeds as glass", breasts),
    "figure21.png": ("Figure 21: a head and a lobster made here, not the published volumes", replaced),
    "figure22.png": ("Figure 22: before a landscape", landscapes),
}


def backdrops() -> dict[str, Backdrop]:
    """Backdrops beside the usual one."""
    colours = ((235, 235, 210), (170, 60, 50))
    red = checkerboard((0.0, 0.0, 2.0), (4.0, 0.0, 0.0), (0.0, -4.0, 0.0), 12, colours)
    near = checkerboard((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, -2.0, 0.0), 16)
    far = checkerboard((0.0, 0.0, 4.0), (8.0, 0.0, 0.0), (0.0, -8.0, 0.0), 24, colours)
    # The rectangle alone, without what goes on beyond it.
    strip = replace(near, endless=False)
    return {"coarser": backdrop_of([red]), "a strip before a plane": backdrop_of([strip, far])}

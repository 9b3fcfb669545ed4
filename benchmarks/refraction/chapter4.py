"""Figures 17 to 22 of the dissertation on our volumes, and Tables 1 to 3 where volumes made here stand in."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from bentray_kernels.refraction import (
    Backdrop,
    Plane,
    backdrop_of,
    checkerboard,
    orthographic,
    perspective,
)
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step
from bentray_workers.files.atomic import write_bytes

from ..eikonal.eikonal import alternate
from ..shared._contact_sheet import Panel, sheet
from ._glass import BEHIND, DOWN, REPEATS, RIGHT, ball, breast, drawn, glass, hills, waves
from ._refraction_ladders import cells, ladder
from ._stand_ins import ISO, stand_ins

PICTURE = Path(__file__).parents[1] / "results" / "chapter4.png"

SMOOTH = "B-spline 3, smooth λ = 1"

# Seconds of Table 1: without supersampling, with four rays a pixel, after refraction.
TABLE1 = {"Catmull-Rom": (7.63, 28.02, 7.72), SMOOTH: (6.65, 26.83, 6.71)}
WAYS = {"none": ("one ray a pixel", 1), "real": ("four rays a pixel", 2), "prss": ("after refraction", 1)}

# Of whole volumes.
WIDER = orthographic((0.0, 0.0, -3.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), 2.3)

# m/s: where the fat of the breast begins, and its tissue.
FAT, TISSUE = 1420.0, 1490.0


def rows(quick: bool, progress: Step) -> Iterable[Row]:
    """Table 1: what each way to supersample costs over none; and the sheet of all figures."""
    pixels = 96 if quick else 352
    panels17 = []
    for name, theirs in TABLE1.items():
        progress(len(panels17), 2 * len(WAYS), name)
        scene = glass(ball(), name)
        # In turn, so that the load of the machine meets all ways alike.
        seconds = alternate(
            {
                way: lambda way=way, degree=degree, scene=scene: drawn(
                    scene, way, degree=degree, pixels=pixels, repeats=1
                )
                for way, (_, degree) in WAYS.items()
            },
            3 * REPEATS,
        )
        for way, (words, degree) in WAYS.items():
            image, _ = drawn(scene, way, degree=degree, pixels=pixels, repeats=1)
            panels17.append(Panel(f"{name}\n{words}, {1e3 * seconds[way]:.0f} ms", image))
        for way, of_theirs in (("real", theirs[1]), ("prss", theirs[2])):
            extra, their_extra = seconds[way] / seconds["none"], of_theirs / theirs[0]
            ours = f"{1e3 * seconds[way]:.0f} over {1e3 * seconds['none']:.0f} ms, one core"
            detail = f"{ours}; theirs {their_extra:.2f}"
            label = f"Table 1 {WAYS[way][0]} / one ray, {name}"
            yield Row(label, extra, 1.05 if way == "prss" else 5.0, "<=", "", detail)
    if quick:
        return
    subjects = stand_ins()
    for k, subject in enumerate(subjects):
        progress(k, len(subjects), subject.name)
        yield from cells(subject)
        yield from ladder(subject, 3)
    landscape = backdrop_of([hills()])
    balls = [
        Panel(words, drawn(glass(ball(n), SMOOTH))[0])
        for n, words in enumerate(("no hole", "one hole", "two"))
    ]
    balls += [
        Panel(words, drawn(glass(ball(2), SMOOTH), backdrop=behind)[0])
        for words, behind in backdrops().items()
    ]
    wavy = backdrop_of([replace(checkerboard(BEHIND, RIGHT, DOWN, 24), relief=4.0 * waves())])
    eye = perspective((0.0, 0.0, -3.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 32.0)
    balls.append(Panel("a warped checkerboard", drawn(glass(ball(1), SMOOTH), backdrop=wavy, camera=eye)[0]))
    nested = [
        Panel("core 1.2, shell 1.5", drawn(glass(ball(), SMOOTH, (60.0, 200.0), (1.0, 1.5, 1.2)))[0]),
        Panel("core 1.8, shell 1.2", drawn(glass(ball(), SMOOTH, (60.0, 200.0), (1.0, 1.2, 1.8)))[0]),
        Panel("hole, shell 1.3, core 1.5", drawn(glass(ball(1), SMOOTH, (60.0, 200.0), (1.0, 1.3, 1.5)))[0]),
        Panel("two holes, the same", drawn(glass(ball(2), SMOOTH, (60.0, 200.0), (1.0, 1.3, 1.5)))[0]),
    ]
    medical = []
    for name in ("central difference", "Catmull-Rom", "B-spline 3", SMOOTH):
        progress(len(medical), 6, f"breast, {name}")
        scene = glass(breast(), name, (FAT, TISSUE), (1.0, 1.15, 1.4))
        medical.append(Panel(name, drawn(scene)[0]))
    # Looked at along z.
    upright = {"head": subjects[0].volume.transpose(0, 2, 1), "lobster": subjects[1].volume[:, ::-1]}
    replaced = []
    for what, volume in upright.items():
        for name in ("central difference", SMOOTH):
            progress(len(replaced), 4, f"{what}, {name}")
            scene = glass(volume, name, (ISO,), (1.0, 1.2))
            replaced.append(Panel(f"{what}, {name}", drawn(scene, camera=WIDER)[0]))
    photo = [
        Panel("ball", drawn(glass(ball(), SMOOTH), backdrop=landscape)[0]),
        Panel("ball with a hole", drawn(glass(ball(1), SMOOTH), backdrop=landscape)[0]),
        Panel(
            "breast", drawn(glass(breast(), SMOOTH, (FAT, TISSUE), (1.0, 1.15, 1.4)), backdrop=landscape)[0]
        ),
        Panel("ball with two holes", drawn(glass(ball(2), SMOOTH), backdrop=landscape)[0]),
    ]
    PICTURE.parent.mkdir(exist_ok=True)
    found = sheet(
        [
            ("Figure 17: two filters, three ways to sample", panels17),
            ("Figure 18: holes of air, and other backdrops", balls),
            ("Figure 19: layers of different index", nested),
            ("Figure 20: a breast of sound speeds as glass", medical),
            ("Figure 21: a head and a lobster made here, not the published volumes", replaced),
            ("Figure 22: before a landscape", photo),
        ]
    )
    write_bytes(PICTURE, found)


def backdrops() -> dict[str, Backdrop]:
    """Backdrops beside the usual one."""
    colours = ((235, 235, 210), (170, 60, 50))
    red = checkerboard((0.0, 0.0, 2.0), (4.0, 0.0, 0.0), (0.0, -4.0, 0.0), 12, colours)
    near = checkerboard((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, -2.0, 0.0), 16)
    far = checkerboard((0.0, 0.0, 4.0), (8.0, 0.0, 0.0), (0.0, -8.0, 0.0), 24, colours)
    return {"coarser": backdrop_of([red]), "a strip before a plane": backdrop_of([alone(near), far])}


def alone(plane: Plane) -> Plane:
    """The rectangle alone, without what goes on beyond it."""
    return replace(plane, endless=False)

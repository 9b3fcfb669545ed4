"""Figures 7 to 9 of the dissertation on our volumes, and the cost of supersampling."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step
from bentray_workers.files.atomic import write_bytes

from ..shared._contact_sheet import Panel, sheet
from ._glass import FILTERS, ball, drawn, glass, lit, rings, slanted

PICTURE = Path(__file__).parents[1] / "results" / "chapter3.png"

# Milliseconds under the pictures of Figure 8: nine rays a pixel, and post-refraction supersampling.
THEIRS_MS = {
    "central difference": (9.9, 2.3),
    "Catmull-Rom": (11.5, 2.8),
    "B-spline 3, no prefilter": (10.5, 2.6),
    "B-spline 3, smooth λ = 1": (10.5, 2.6),
}


def rows(quick: bool, progress: Step) -> Iterable[Row]:
    """Seconds of nine rays a pixel over those of one with neighbours, filter by filter; and the sheet."""
    pixels = 96 if quick else 352
    volume = ball()
    single, many, post = [], [], []
    for k, name in enumerate(FILTERS):
        progress(k, len(FILTERS), f"ball, {name}")
        scene = glass(volume, name)
        image, seconds = drawn(scene, "none", pixels=pixels)
        single.append(Panel(f"{name}\n{1e3 * seconds:.0f} ms", image))
        if name not in THEIRS_MS:
            continue
        image, nine = drawn(scene, "real", degree=3, pixels=pixels)
        many.append(Panel(f"{name}\n{1e3 * nine:.0f} ms", image))
        image, one = drawn(scene, "prss", pixels=pixels)
        post.append(Panel(f"{name}\n{1e3 * one:.0f} ms", image))
        theirs = THEIRS_MS[name][0] / THEIRS_MS[name][1]
        detail = f"{pixels}², one core: {1e3 * nine:.0f} over {1e3 * one:.0f} ms; theirs {theirs:.1f}"
        yield Row(f"Figure 8 nine rays / supersampling, {name}", nine / one, theirs, ">=", "", detail)
    surface = rings()
    signal = []
    for k, name in enumerate(FILTERS):
        progress(k, len(FILTERS), f"Marschner-Lobb, {name}")
        signal.append(Panel(name, lit(glass(surface, name, (0.5,)), slanted())))
    if not quick:
        PICTURE.parent.mkdir(exist_ok=True)
        found = sheet(
            [
                ("Figure 7: a glass ball of 8 bits before a checkerboard, one ray a pixel", single),
                ("Figure 8: nine rays a pixel ...", many),
                ("... and one, supersampled after refraction", post),
                ("Figure 9: the Marschner-Lobb signal, 40 nodes along each edge", signal),
            ]
        )
        write_bytes(PICTURE, found)

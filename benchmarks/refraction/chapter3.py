"""Figures 7 to 9 of the dissertation on our volumes, and the cost of supersampling."""

from collections.abc import Iterable

from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step

from ..shared._pictures import Panel, sheet
from ._glass import FILTERS, ball, drawn, glass, lit, rings, slanted

# Milliseconds under the pictures of Figure 8: nine rays a pixel, and post-refraction supersampling.
THEIRS_MS = {
    "central difference": (9.9, 2.3),
    "Catmull-Rom": (11.5, 2.8),
    "B-spline 3, no prefilter": (10.5, 2.6),
    "B-spline 3, smooth λ = 1": (10.5, 2.6),
}


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Seconds of nine rays a pixel over those of one with neighbours, by filter; Figures 2 and 7 to 9."""
    pixels = 96 if context.quick else 352
    volume = ball()
    single, many, post = [], [], []
    for k, name in enumerate(FILTERS):
        context.progress(k, len(FILTERS), f"ball, {name}")
        scene = glass(volume, name)
        image, seconds = drawn(scene, "none", pixels=pixels)
        single.append(Panel(f"{name}\n{1e3 * seconds:.0f} ms", image))
        if name not in THEIRS_MS:
            continue
        image, nine = drawn(scene, "real", degree=3, pixels=pixels)
        many.append(Panel(f"{name}\n{1e3 * nine:.0f} ms", image))
        image, frame_s = drawn(scene, "prss", pixels=pixels)
        post.append(Panel(f"{name}\n{1e3 * frame_s:.0f} ms", image))
        theirs = THEIRS_MS[name][0] / THEIRS_MS[name][1]
        detail = f"{pixels}², one core: {1e3 * nine:.0f} over {1e3 * frame_s:.0f} ms; theirs {theirs:.1f}"
        yield Row(f"Figure 8 nine rays / supersampling, {name}", nine / frame_s, theirs, ">=", "", detail)
    title = "Figure 7: a glass ball of 8 bits before a checkerboard, one ray a pixel"
    context.save_picture("figure7.png", lambda: sheet([(title, single)]))
    poor = [panel for panel in single if panel.name.startswith("Catmull-Rom")]
    context.save_picture("figure2.png", lambda: sheet([("Figure 2: Catmull-Rom", poor)]))
    ways = [("Figure 8: nine rays a pixel ...", many), ("... and one, supersampled after refraction", post)]
    context.save_picture("figure8.png", lambda: sheet(ways))
    context.save_picture("figure9.png", lambda: figure9(context.progress))


def figure9(progress: Step) -> bytes:
    """The Marschner-Lobb signal, read by each filter."""
    surface = rings()
    panels = []
    for k, name in enumerate(FILTERS):
        progress(k, len(FILTERS), f"Marschner-Lobb, {name}")
        panels.append(Panel(name, lit(glass(surface, name, (0.5,)), slanted())))
    return sheet([("Figure 9: the Marschner-Lobb signal, 40 nodes along each edge", panels)])

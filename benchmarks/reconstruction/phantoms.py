"""Tables 6 and 7 of the dissertation beside the phantoms here, and pictures of slices, fronts and rays."""

from collections.abc import Iterable, Sequence

import numpy as np

from bentray_kernels import eikonal, rays
from bentray_kernels.phantoms import TABLE6_SIDE_M, Ellipse, Part, table6, table6_vertical, table7
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_workers.images.canvas import drawing, new_figure
from bentray_workers.images.maps import ATTENUATION, SPEED, draw_bar, draw_map, robust_limits

from ..shared._pictures import figure_png

WATER_MPS, FAT_MPS = 1500.0, 1375.0

# Speed, m/s, and attenuation, without a unit, of both tables; skin of Table 7 alone.
PUBLISHED = {
    "tissue": (1475.0, (50.0,)),
    "fat": (1375.0, (15.0,)),
    "large lesion": (1560.0, (30.0, 60.0)),
    "small lesion": (1530.0, (70.0,)),
    "skin": (1650.0, (58.0,)),
}
RECEIVERS = 31
NODES = 256


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Speed and attenuation of each tissue, equal to the published ones, and Figures 28 and 30."""
    phantoms = {
        "Table 6": table6(WATER_MPS).ellipses,
        "Table 6, vertical slice": table6_vertical(WATER_MPS).ellipses,
        "Table 7": table7(WATER_MPS).parts,
    }
    for number, (table, parts) in enumerate(phantoms.items()):
        context.progress(number, len(phantoms), table)
        yield from table_rows(table, parts)
    context.save_picture("figure28.png", figure28)
    context.save_picture("figure30.png", figure30)
    context.progress(len(phantoms), len(phantoms), "done")


def table_rows(table: str, parts: Sequence[Ellipse | Part]) -> Iterable[Row]:
    """Rows of the tissues that a phantom has."""
    for name, (speed, attenuations) in PUBLISHED.items():
        own = [part for part in parts if part.name == name]
        speeds, losses = {part.speed_mps for part in own}, sorted({part.attenuation_np_m for part in own})
        if not own:
            continue
        (only,) = speeds
        detail = f"parts of this tissue: {len(own)}"
        yield Row(f"{table}, {name}, speed", only, speed, "==", "m/s", detail)
        detail += "; the unit of the published attenuation is not stated"
        for loss, theirs in zip(losses, attenuations, strict=True):
            yield Row(f"{table}, {name}, attenuation {theirs:g}", loss, theirs, "==", "Np/m", detail)


def figure28() -> bytes:
    """Wave fronts from one emitter, and bent and straight rays to 31 receivers, in two waters."""
    spacing, half = TABLE6_SIDE_M / (NODES - 1), TABLE6_SIDE_M / 2
    angle = np.radians(np.linspace(110.0, 250.0, RECEIVERS))
    receivers = half + 0.092 * np.column_stack((np.cos(angle), np.sin(angle)))
    source = np.array([half + 0.092, half])
    with drawing():
        figure = new_figure(8.4, 4.3)
        figure.suptitle("Figure 28: wave fronts, bent rays (red) and straight rays (yellow)")
        maps = []
        for axes, water in zip(figure.subplots(1, 2, sharey=True), (FAT_MPS, WATER_MPS), strict=True):
            speed = table6(water).speed(NODES, TABLE6_SIDE_M)
            time = eikonal.solve(speed, spacing, source)
            where = (spacing, spacing), (-half, -half)
            maps.append(
                draw_map(axes, speed, *where, robust_limits([speed]), colormap=SPEED, title=f"{water:g} m/s")
            )
            x_mm = 1e3 * (np.arange(NODES) * spacing - half)
            axes.contour(x_mm, x_mm, 1e6 * time.T, np.arange(5, 150, 5), colors="white", linewidths=0.5)
            for path, end in zip(rays.trace(time, spacing, receivers, source), receivers, strict=True):
                straight = 1e3 * (np.array([source, end]) - half)
                axes.plot(*straight.T, color="#ffd23f", linewidth=0.7)
                axes.plot(*(1e3 * (path - half)).T, color="#e4343f", linewidth=0.9)
            axes.label_outer()
        draw_bar(maps, "sound speed (m/s)")
        return figure_png(figure)


def figure30() -> bytes:
    """Speed and attenuation of the horizontal and of the vertical slice."""
    spacing, half = TABLE6_SIDE_M / (NODES - 1), TABLE6_SIDE_M / 2
    where = (spacing, spacing), (-half, -half)
    slices = {"horizontal": table6(WATER_MPS), "vertical": table6_vertical(WATER_MPS)}
    with drawing():
        figure = new_figure(8.4, 7.6)
        figure.suptitle("Figures 29 and 30: slices of the phantom")
        columns = figure.subplots(2, 2, sharex=True, sharey=True)
        for column, (name, phantom) in zip(columns, slices.items(), strict=True):
            for axes, image, colours, label in (
                (column[0], phantom.speed(NODES, TABLE6_SIDE_M), SPEED, "sound speed (m/s)"),
                (column[1], phantom.attenuation(NODES, TABLE6_SIDE_M), ATTENUATION, "attenuation (Np/m)"),
            ):
                title = f"{name} slice"
                drawn = draw_map(axes, image, *where, robust_limits([image]), colormap=colours, title=title)
                draw_bar([drawn], label)
                axes.label_outer()
        return figure_png(figure)

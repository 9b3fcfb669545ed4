"""Maps: images in mm with the outline of a region, colour limits and colour bars."""

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.image import AxesImage
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Limits = tuple[float, float]

SPEED = "viridis"
DIFFERENCE = "RdBu_r"
COVERAGE = "magma"
ATTENUATION = "cividis"
RECOVERY = "bone"
UNCERTAINTY = "inferno"
MISSING = "#e4e4e4"

REFLECTION = "gray"

# Of the recovered fraction, and of the reflection, dB.
FIXED_LIMITS = {"recovery": (0.0, 1.0), "reflection": (-50.0, 0.0)}

# Quantities whose colours begin at 0.
FROM_ZERO = ("coverage", "uncertainty")

# Nodes outside robust limits at each end, per cent.
OUTSIDE_PERCENT = 0.1


def robust_limits(images: Iterable[Floats], region: Bools | None = None) -> Limits:
    """Lowest and highest value without outliers; never equal."""
    values = np.concatenate(
        [image[np.isfinite(image) if region is None else region & np.isfinite(image)] for image in images]
    )
    if not values.size:
        return 0.0, 1.0
    low, high = np.percentile(values, [OUTSIDE_PERCENT, 100.0 - OUTSIDE_PERCENT])
    least = 1e-6 * max(abs(low), abs(high)) or 1.0
    return (float(low), float(high)) if high - low > least else (float(low - least), float(low + least))


def symmetric_limits(images: Iterable[Floats]) -> Limits:
    """Like ``robust_limits``, with 0 in the middle."""
    reach = max(map(abs, robust_limits(images)))
    return -reach, reach


def draw_map(
    axes: Axes,
    image: Floats,
    spacing_m: tuple[float, ...],
    origin_m: tuple[float, ...],
    limits: Limits,
    *,
    colormap: str,
    title: str,
    outline: Bools | None = None,
    up: str = "y",
) -> AxesImage:
    """An image (nx, ny) with x to the right and y up, in mm, and the outline of a region of that shape.

    ``up`` replaces y by another axis, with its spacing and origin.
    """
    points = [1e3 * (o + h * np.arange(n)) for o, h, n in zip(origin_m, spacing_m, image.shape, strict=False)]
    half = [0.5e3 * h for h in spacing_m]
    shown = axes.imshow(
        np.ma.masked_invalid(image.T),
        origin="lower",
        extent=(
            points[0][0] - half[0],
            points[0][-1] + half[0],
            points[1][0] - half[1],
            points[1][-1] + half[1],
        ),
        vmin=limits[0],
        vmax=limits[1],
        cmap=colormaps[colormap].with_extremes(bad=MISSING),
        interpolation="nearest",
        aspect="equal",
    )
    if outline is not None and outline.any() and not outline.all() and min(outline.shape) > 1:
        colour = "#555555" if colormap == DIFFERENCE else "#ffffff"
        axes.contour(*points, outline.T.astype(float), levels=[0.5], colors=colour, linewidths=0.5)
    axes.set_title(title)
    axes.set_xlabel("x (mm)")
    axes.set_ylabel(f"{up} (mm)", labelpad=1)
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.yaxis.set_major_locator(MaxNLocator(5))
    return shown


def draw_bar(maps: Sequence[AxesImage], label: str, bar_axes: Axes | None = None) -> None:
    """One colour bar for maps of the same limits; pointed if values exceed it.

    It is drawn at ``bar_axes``, by default beside the last map, which shrinks all maps.
    """
    low, high = maps[0].get_clim()
    values: list[Floats] = [
        np.ma.masked_invalid(np.ma.asarray(shown.get_array())).compressed() for shown in maps
    ]
    below = min((float(v.min()) for v in values if v.size), default=math.inf) < low
    above = max((float(v.max()) for v in values if v.size), default=-math.inf) > high
    extend = {(False, False): "neither", (True, False): "min", (False, True): "max"}.get(
        (below, above), "both"
    )
    axes = [shown.axes for shown in maps]
    layout: dict[str, Any] = (
        {"ax": axes, "fraction": 0.046, "pad": 0.015, "aspect": 26} if bar_axes is None else {"cax": bar_axes}
    )
    bar = axes[0].figure.colorbar(maps[0], extend=extend, **layout)
    bar.set_label(label)
    bar.outline.set_linewidth(0.4)

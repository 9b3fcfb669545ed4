"""Picture of the reflection benchmark: reconstructed speed, and images with delays in it and in water."""

from collections.abc import Mapping

import numpy as np

from bentray_kernels.tomography import Reconstruction
from bentray_kernels.tomography.result import Reflection
from bentray_workers.images.canvas import drawing, new_figure, to_png
from bentray_workers.images.captions import LABELS
from bentray_workers.images.maps import REFLECTION, SPEED, draw_bar, draw_map, robust_limits

from ._fat_scan import CYST, CYST_M, GLAND_M, LINE, POINTS, FatScan

# Lowest value that is drawn, dB.
LOWEST_DB = -50.0


def picture(size: FatScan, images: Mapping[str, Reflection], result: Reconstruction) -> bytes:
    """The speed, then each image of the gland, relative to its own maximum there; targets are circled."""
    with drawing():
        figure = new_figure(4.2 * (1 + len(images)), 3.9)
        panels = figure.subplots(1, 1 + len(images))
        limits = robust_limits([result.speed], result.coverage > 0.0)
        grid = result.spacing_m, result.origin_m
        shown = draw_map(panels[0], result.speed, *grid, limits, colormap=SPEED, title="Reconstructed speed")
        draw_bar([shown], LABELS["speed"])
        for axes, (name, image) in zip(panels[1:], images.items(), strict=True):
            x, y = (image.origin_m[k] + image.spacing_m[k] * np.arange(image.db.shape[k]) for k in (0, 1))
            gland = np.hypot(x[:, None], y[None, :]) < GLAND_M
            relative = image.db - image.db[gland].max()
            title = "No fat, delays in water" if name == "no fat" else f"Delays in {name}"
            shown = draw_map(
                axes,
                relative,
                image.spacing_m,
                image.origin_m,
                (LOWEST_DB, 0.0),
                colormap=REFLECTION,
                title=title,
            )
            draw_bar([shown], LABELS["reflection"])
            reach = 1e3 * (GLAND_M + 2.0 * size.wavelength_m)
            axes.set_xlim(-reach, reach)
            axes.set_ylim(-reach, reach)
            turn = np.linspace(0.0, 2.0 * np.pi, 60)
            for centre, radius in (*((point, size.wavelength_m) for point in POINTS), (CYST, CYST_M)):
                circle = np.array(centre)[:, None] + radius * np.stack((np.cos(turn), np.sin(turn)))
                axes.plot(*(1e3 * circle), color="#ffb000", linewidth=0.6)
            for side in (-1.0, 1.0):
                height = LINE[0][1] + side * size.wavelength_m
                axes.plot(
                    [1e3 * LINE[0][0], 1e3 * LINE[1][0]], [1e3 * height] * 2, color="#ffb000", linewidth=0.6
                )
        return to_png(figure)

"""Picture of the uncertainty: calibration curve, parts of each scan, and one image with its deviations."""

from collections.abc import Sequence

import numpy as np
from scipy.special import erf

from bentray_workers.images.canvas import drawing, new_figure
from bentray_workers.images.captions import LABELS
from bentray_workers.images.maps import SPEED, UNCERTAINTY, draw_bar, draw_map, robust_limits

from ..shared._pictures import figure_png
from ._judged_image import Judged, relative

SHADOW, OTHER, CAUTION = "#c1272d", "#1f5fa8", "#9aa7b5"


def calibration_picture(judged: Sequence[Judged]) -> bytes:
    """PNG of four panels: two of all scans, two of the last image."""
    with drawing():
        figure = new_figure(15.0, 3.9)
        curve, bars, image, spread = figure.subplots(1, 4)
        deviations = np.linspace(0.0, 4.0, 81)
        curve.plot(deviations, erf(deviations / np.sqrt(2.0)), color="#555555", dashes=(4, 2), label="normal")
        worst = min(judged, key=lambda image: image.within)
        for label, group, colour in (
            ("all scans", judged, OTHER),
            ("scan with the fewest", [worst], SHADOW),
        ):
            sizes = np.concatenate([relative(image) for image in group])
            curve.plot(deviations, [(sizes <= k).mean() for k in deviations], color=colour, label=label)
        curve.plot([2.0], [0.85], "o", color="#e08a00", label="goal")
        curve.set_xlabel("deviations")
        curve.set_ylabel("part of the nodes within")
        curve.set_xlim(0.0, 4.0)
        curve.set_ylim(0.0, 1.0)
        curve.set_title("Calibration")
        curve.legend(loc="lower right", fontsize=8)
        colours = [
            SHADOW if image is worst else CAUTION if image.result.caution("uncertainty") else OTHER
            for image in judged
        ]
        bars.bar(range(len(judged)), [100.0 * image.within for image in judged], color=colours)
        bars.axhline(85.0, color="#e08a00", linewidth=1.0)
        bars.set_xlabel("scan (grey: with a caution)")
        bars.set_ylabel("nodes within two deviations (%)")
        bars.set_title("Each scan")
        result = judged[-1].result
        assert result.uncertainty is not None
        grid = result.spacing_m, result.origin_m
        title = f"Speed of scan {judged[-1].name.split(':')[0]}"
        limits = robust_limits([result.speed])
        shown = draw_map(image, result.speed, *grid, limits, colormap=SPEED, title=title)
        draw_bar([shown], LABELS["speed"])
        limits = 0.0, robust_limits([result.uncertainty])[1]
        width = 1e3 * result.resolution_width_m[0]
        title = f"Deviation, width {width:.1f} mm"
        shown = draw_map(spread, result.uncertainty, *grid, limits, colormap=UNCERTAINTY, title=title)
        draw_bar([shown], LABELS["uncertainty"])
        return figure_png(figure)

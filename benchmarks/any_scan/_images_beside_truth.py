"""Picture of scans: the truth and its images by several settings, a row for each scan."""

from collections.abc import Mapping

from bentray_kernels.acquisition import Dataset
from bentray_workers.images.canvas import drawing, new_figure
from bentray_workers.images.maps import SPEED, draw_bar, draw_map, robust_limits

from ..shared._reconstruction_on_workers import Made
from ..shared._small_png import figure_png


def images_beside_truth(title: str, scans: Mapping[str, tuple[Dataset, Mapping[str, Made]]]) -> bytes:
    """PNG of the truth and the images, each with its error and time.

    Args:
        title: of the picture.
        scans: by name, a scan with its truth, and as many images as for the others, by name.
    """
    columns = 1 + max(len(images) for _, images in scans.values())
    with drawing():
        figure = new_figure(3.0 * columns, 3.1 * len(scans) + 0.4)
        figure.suptitle(title)
        panels = figure.subplots(len(scans), columns, squeeze=False)
        for row, (name, (dataset, images)) in zip(panels, scans.items(), strict=True):
            truth = dataset.truth
            assert truth is not None
            limits = robust_limits([truth.sound_speed_mps])
            grid = truth.spacing_m, truth.origin_m
            heading = f"{name}: truth"
            maps = [draw_map(row[0], truth.sound_speed_mps, *grid, limits, colormap=SPEED, title=heading)]
            for axes, (way, made) in zip(row[1:], images.items(), strict=True):
                heading = f"{way}: {made.rms:.1f} m/s, {made.seconds:.0f} s"
                grid = made.result.spacing_m, made.result.origin_m
                maps.append(draw_map(axes, made.result.speed, *grid, limits, colormap=SPEED, title=heading))
            draw_bar(maps, "speed (m/s)")
        return figure_png(figure)

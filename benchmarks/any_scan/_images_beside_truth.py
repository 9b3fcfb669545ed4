"""Picture of scans: the truth and its images by several settings, a row for each scan."""

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes

from bentray_kernels.acquisition import Dataset, Truth
from bentray_kernels.arrays import Floats
from bentray_kernels.tomography import Reconstruction
from bentray_workers.images.canvas import drawing, new_figure
from bentray_workers.images.maps import SPEED, draw_bar, draw_map, robust_limits

from ..shared._pictures import figure_png
from ..shared._reconstruction_on_workers import Made


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
            draw_beside_truth(row, f"{name}: truth", dataset, images, ": ")
        return figure_png(figure)


def draw_beside_truth(
    row: Sequence[Axes], title: str, dataset: Dataset, images: Mapping[str, Made], colon: str
) -> None:
    """The truth of a scan under its title, and the images on its scale, ``colon`` after their names."""
    truth = dataset.truth
    assert truth is not None
    limits = robust_limits([truth.sound_speed_mps])
    drawn: dict[str, tuple[Floats, Truth | Reconstruction]] = {title: (truth.sound_speed_mps, truth)}
    for way, made in images.items():
        drawn[f"{way}{colon}{made.rms:.1f} m/s, {made.seconds:.0f} s"] = made.result.speed, made.result
    maps = [
        draw_map(axes, speed, grid.spacing_m, grid.origin_m, limits, colormap=SPEED, title=heading)
        for axes, (heading, (speed, grid)) in zip(row, drawn.items(), strict=True)
    ]
    draw_bar(maps, "speed (m/s)")

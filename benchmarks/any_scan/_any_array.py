"""A3: arrays of other shapes than a ring by default settings, beside straight rays and constants."""

import os
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from bentray_kernels.acquisition import Dataset, Truth
from bentray_kernels.acquisition.simulation.array_shapes import arc, bowl, facing_lines
from bentray_kernels.acquisition.simulation.fine_medium import FineMedium
from bentray_kernels.arrays import Floats, Ints
from bentray_kernels.phantoms import Ellipsoid, Part, VolumePhantom
from bentray_kernels.tomography import Problem, Reconstruction, Settings, reconstruct
from bentray_kernels.tomography.comparison import on_grid
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import CONSTANTS, WATER_ALONE, Row
from bentray_workers.images.canvas import drawing, new_figure
from bentray_workers.images.maps import SPEED, draw_bar, draw_map, robust_limits

from ..shared._baselines import Compared, Images
from ..shared._image_error import ErrorOn, ImageError
from ..shared._pictures import figure_png

WATER_MPS, RADIUS_M, SIDE_M = 1480.0, 0.095, 0.2

# Fat, gland and two lesions; height of their middle, m.
MIDDLE_M = -0.04
PHANTOM = VolumePhantom(
    WATER_MPS,
    tuple(
        Part(Ellipsoid((x, y, MIDDLE_M + z), size, angle), speed, 0.0, name)
        for name, (x, y, z), size, angle, speed in (
            ("fat", (0.0, 0.0, 0.0), (0.068, 0.062, 0.036), 0.0, 1445.0),
            ("gland", (0.004, 0.002, 0.0), (0.050, 0.040, 0.027), 0.6, 1510.0),
            ("fast lesion", (0.022, 0.012, 0.002), (0.013, 0.010, 0.012), 0.0, 1560.0),
            ("slow lesion", (-0.018, -0.010, 0.0), (0.009, 0.009, 0.010), 0.0, 1450.0),
        )
    ),
)

# Elements of a whole ring, of a bowl and along a side of a plane, and nodes of the grids of the simulations.
ELEMENTS, BOWL, PLANE, FINE_NODES, FINE_NODES_IN_SPACE = 96, 72, 6, 385, 79

# Of images in 3-D, whose automatic grid takes minutes.
NODES_IN_SPACE = 40


class Array(NamedTuple):
    """An array.

    Attributes:
        position_m: (elements, 2 or 3), m.
        tx, rx: elements that emit and receive; None: all.
        limited: whether its coverage by angle is incomplete, which the result must state.
    """

    position_m: Floats
    tx: Ints | None = None
    rx: Ints | None = None
    limited: bool = False


class Made(NamedTuple):
    """The image of a scan by default settings, with the truth on its grid.

    Attributes:
        result: the image.
        error: the truth, and the nodes inside the hull of the array.
        compared: rms error inside the hull and its baselines, m/s.
        seconds: wall-clock time.
    """

    result: Reconstruction
    error: ImageError
    compared: Compared
    seconds: float


def arrays(*, quick: bool) -> dict[str, Array]:
    """The arrays by their names."""
    count = ELEMENTS // 2 if quick else ELEMENTS
    ring, per_degree = arc(count, RADIUS_M).position_m, count / 360.0
    half = count // 2
    by_name = {
        "ring": Array(ring),
        "arc of 270°": Array(arc(round(270 * per_degree), RADIUS_M, 270.0).position_m, limited=True),
        "arc of 200°": Array(arc(round(200 * per_degree), RADIUS_M, 200.0).position_m, limited=True),
        "facing lines": Array(
            facing_lines(half, 0.18, 0.17).position_m, np.arange(half), np.arange(half, 2 * half), True
        ),
        "one element inside": Array(np.vstack((ring, [[0.071, -0.055]]))),
        "emitters apart": Array(ring, np.arange(0, count, 2), np.arange(1, count, 2)),
    }
    if quick:
        return by_name
    side = np.linspace(-0.075, 0.075, PLANE)
    flat = np.stack(np.meshgrid(side, np.linspace(-0.085, 0.005, PLANE)), axis=-1).reshape(-1, 2)
    planes = np.concatenate([np.insert(flat, 1, y, axis=1) for y in (-0.085, 0.085)])
    each = PLANE**2
    by_name["bowl"] = Array(bowl(BOWL, RADIUS_M).position_m)
    by_name["facing planes"] = Array(planes, np.arange(each), np.arange(each, 2 * each), True)
    return by_name


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """A3 for each array, with a picture of all of them."""
    images = {}
    chosen = arrays(quick=context.quick)
    for number, (name, array) in enumerate(chosen.items()):
        context.progress(number, len(chosen), name)
        images[name] = made(simulated(array))
        yield array_row(name, array, images[name])
    stated = sum(
        ("Limited angle" in images[name].result.provenance.get("geometry", "")) == array.limited
        for name, array in chosen.items()
    )
    detail = "; ".join(
        f"{name}: {made.result.provenance.get('geometry', 'nothing')}" for name, made in images.items()
    )
    yield Row(
        "A3 arrays that state a limited angle, if they have one", stated, len(chosen), "==", "arrays", detail
    )
    context.save_picture("any_scan_arrays.png", lambda: picture(images))


def simulated(array: Array) -> Dataset:
    """Eikonal times through the phantom or its middle slice, on a finer grid."""
    position = array.position_m
    in_space = position.shape[1] == 3
    side = SIDE_M
    spacing = side / ((FINE_NODES_IN_SPACE if in_space else FINE_NODES) - 1)
    if in_space:
        low, high = position[:, 2].min() - 4 * spacing, position[:, 2].max() + 4 * spacing
        z = np.arange(low, high, spacing)
        speed, origin = PHANTOM.speed(FINE_NODES_IN_SPACE, side, z), (-0.5 * side, -0.5 * side, low)
    else:
        speed, origin = PHANTOM.at(MIDDLE_M).speed(FINE_NODES, side), (-0.5 * side, -0.5 * side)
    everyone = np.arange(len(position))
    tx, rx = (everyone if index is None else index for index in (array.tx, array.rx))
    delta, _ = FineMedium(speed, spacing, WATER_MPS).arrivals(position - np.array(origin), tx)
    truth = Truth(speed, (spacing,) * len(origin), origin, axes="x,y,z" if in_space else "x,y")
    return Dataset(position, tx, rx, WATER_MPS, delta_tof_s=delta[:, rx], truth=truth, array_type="free")


def made(dataset: Dataset) -> Made:
    """The image of a scan, its error and its baselines."""
    nodes, error_on = (
        NODES_IN_SPACE if dataset.element_position_m.shape[1] == 3 else None,
        hull_error(dataset),
    )
    images = Images(dataset, reconstruct, Settings(nodes=nodes))
    result, seconds = images.default()
    return Made(result, error_on(result), images.compared(result, error_on), seconds)


def hull_error(dataset: Dataset) -> ErrorOn:
    """Root mean square error inside the hull of the array, m/s."""
    truth = dataset.truth
    assert truth is not None

    def error_on(image: Reconstruction) -> ImageError:
        true = on_grid(truth.sound_speed_mps, truth, image)
        # Nodes beside the simulated medium, in which there are elements at most, do not count.
        return ImageError(true, Problem.from_dataset(dataset, image.settings).region & np.isfinite(true))

    return error_on


def array_row(name: str, array: Array, made: Made) -> Row:
    """The error by default settings over that of the better constant."""
    least = min(made.compared.baselines[constant] for constant in CONSTANTS)
    nodes = " by ".join(map(str, made.result.speed.shape))
    detail = (
        f"{made.compared.error:.1f} m/s inside the hull, {made.seconds:.1f} s; {len(array.position_m)} "
        f"elements, {nodes} nodes; {made.result.settings.rays} {made.result.settings.method}; "
        f"load at the end {os.getloadavg()[0]:.1f}"
    )
    target = f"A3 {name}: error over that of the best constant"
    return made.compared.row(target, made.compared.error / least, 1.0, "<", "", detail)


def picture(images: Mapping[str, Made]) -> bytes:
    """PNG: truth and image of each array; of volumes the plane through the middle of the phantom."""
    with drawing():
        columns = min(4, len(images))
        blocks = -(-len(images) // columns)
        figure = new_figure(3.0 * columns, 5.6 * blocks)
        figure.suptitle(
            "Truth, and below it the image by default settings; the line is the hull less its rim"
        )
        panels = figure.subplots(2 * blocks, columns, squeeze=False)
        pairs = [(panels[2 * k, n], panels[2 * k + 1, n]) for k in range(blocks) for n in range(columns)]
        for above, below in pairs[len(images) :]:
            above.remove()
            below.remove()
        limits = robust_limits([made.error.true for made in images.values()])
        maps = []
        for column, (name, made) in zip(pairs, images.items(), strict=False):
            water = made.compared.baselines[WATER_ALONE]
            titles = name, f"{made.compared.error:.1f} m/s (water {water:.1f})"
            at = ...
            if made.error.true.ndim == 3:
                height = (MIDDLE_M - made.result.origin_m[2]) / made.result.spacing_m[2]
                at = (slice(None), slice(None), round(height))
            grid = made.result.spacing_m[:2], made.result.origin_m[:2]
            for axes, values, title in zip(column, (made.error.true, made.result.speed), titles, strict=True):
                outline = made.error.region[at]
                maps.append(
                    draw_map(axes, values[at], *grid, limits, colormap=SPEED, title=title, outline=outline)
                )
        draw_bar(maps, "speed (m/s)")
        return figure_png(figure)

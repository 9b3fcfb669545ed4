"""R9 and Figure 34: the volume of Table 7 scanned by fronts in space; images by slices and in space."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.acquisition.simulation.volume_scan import VolumeScan
from bentray_kernels.arrays import Floats, Ints
from bentray_kernels.phantoms import TABLE7_SIDE_M, table7_slices
from bentray_kernels.tomography import Reconstruction, Settings
from bentray_kernels.tomography.problem import MARGIN_NODES
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import STRAIGHT_RAYS, Row
from bentray_workers.simulation.plane import ring_radius

from ..shared._baselines import Images
from ..shared._reconstruction_on_workers import reconstruct_file
from ._kept_times import travel_times
from ._sections_picture import Panel, picture
from ._table7_errors import Slices, contrasts, least_contrast, on_phantom_nodes
from ._table7_slices import Skin, varied
from .chapter7_waves import BY_SLICES, IN_SPACE, SMALLEST_VOXELS, VISIBLE

COUPLING_MPS = 1375.0

# With the skin of Table 7 first arrivals run round the breast in it.
SKINS: tuple[Skin, ...] = ("no skin", "skin")

GOALS = {"slices": BY_SLICES, "in space": IN_SPACE}


@dataclass(frozen=True)
class Array:
    """Rings at all heights that receive; a few of them emit, their elements evenly spaced and staggered.

    The emitting rings judge. Nothing was chosen on their heights.

    Attributes:
        nodes: of the image along x and y.
        heights: of rings, a node apart, centred on the phantom.
        elements: of each ring.
        rings: numbers of those that emit.
        emitters: of each of these.
        fewer: in space, receivers of other rings than that of the emitter are this many times fewer.
        refinement: of the grid of the times over that of the image.
        finest: of the grid that tells their error.
    """

    nodes: int = 128
    heights: int = 40
    elements: int = 256
    rings: tuple[int, ...] = (2, 9, 16, 23, 30, 37)
    emitters: int = 8
    fewer: int = 16
    refinement: int = 2
    finest: int = 6

    def scan(self, skin: Skin) -> VolumeScan:
        """The scan of all rings."""
        return VolumeScan(
            varied(COUPLING_MPS, skin),
            Ring(self.elements, ring_radius(TABLE7_SIDE_M, self.nodes)),
            tuple(table7_slices(self.nodes, self.heights).tolist()),
            TABLE7_SIDE_M,
            self.nodes,
            self.refinement,
            three_d=True,
        )

    @property
    def emitting(self) -> Ints:
        """(emitting rings, emitters of each), numbers of elements."""
        evenly = np.arange(self.emitters) * (self.elements // self.emitters)
        staggered = [(evenly + 3 * place) % self.elements for place in range(len(self.rings))]
        return np.asarray(self.elements * np.array(self.rings)[:, None] + staggered)


QUICK = Array(24, 6, 24, (1, 4), 4, 2, finest=4)


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Errors on the heights that judge, of images by slices and in space, and the error of the times."""
    array = QUICK if context.quick else Array()
    panels: list[Panel] = []
    for skin in SKINS[:1] if context.quick else SKINS:
        scan = array.scan(skin)
        delta = travel_times(scan, array.emitting.ravel().tolist(), context.progress)
        images = made(context, skin, array, scan, delta)
        yield from errors(skin, array, scan, images)
        misfit = next(step.residual_rms_s for step in reversed(images["in space"].history) if step.given)
        yield error_of_times(context, skin, array, misfit)
        panels += shown(skin, array, scan, images)
    title = "Volume of Table 7 (Li 2008), scanned in space: rms error over the range, judged heights"
    context.save_picture("reconstruction_volume.png", lambda: picture(title, panels, 4, TABLE7_SIDE_M))
    context.progress(1, 1, "done")


def made(
    context: BenchmarkContext, skin: Skin, array: Array, scan: VolumeScan, delta: Floats
) -> dict[str, Reconstruction]:
    """Images by slices and in space, each beside straight rays by the same settings.

    Args:
        delta: times of each emitter to all elements, s.
    """
    emitters, position = array.emitting.ravel(), scan.positions()
    everyone = np.arange(len(position))
    ring = everyone // array.elements
    # Slices know the emitting rings alone.
    members = np.flatnonzero(np.isin(ring, array.rings))
    by_slices = Dataset(
        position[members],
        np.searchsorted(members, emitters),
        np.arange(len(members)),
        COUPLING_MPS,
        delta_tof_s=delta[:, members],
        array_type="rings",
    )
    heard = (ring[emitters][:, None] == ring) | (everyone % array.fewer == 0)
    together = heard.any(axis=0)
    in_space = replace(
        by_slices,
        element_position_m=position,
        tx=emitters,
        rx=everyone[together],
        delta_tof_s=np.where(heard, delta, np.nan)[:, together],
    )
    images: dict[str, Reconstruction] = {}
    for way, dataset, decomposition in (("slices", by_slices, "slices"), ("in space", in_space, "volume")):
        run = Images(
            dataset,
            lambda scan, settings, way=way: (
                reconstruct_file(scan, settings, context, None, f"{skin}, {way}", threads=None).result
            ),
        )
        # Without the reverse pairs, by which every receiver would be an emitter of a few pairs.
        settings = Settings.from_values(
            method="gauss-newton",
            decomposition=decomposition,
            nodes=array.nodes,
            side_m=TABLE7_SIDE_M,
            reciprocity=False,
            uncertainty=False,
        )
        images[way] = run.made(settings).result
        images[f"{way}, {STRAIGHT_RAYS}"] = run.straight(images[way])
    return images


def at_heights(image: Reconstruction, levels: Sequence[int]) -> list[Floats]:
    """Levels of an image on the nodes of the phantom."""
    sections = (replace(image, speed=image.speed[..., k], coverage=image.coverage[..., k]) for k in levels)
    return [on_phantom_nodes(section, COUPLING_MPS) for section in sections]


def judged(array: Array, images: Mapping[str, Reconstruction]) -> dict[str, list[Floats]]:
    """Images on the heights that judge: all levels of slices, a few of a volume."""
    rings = range(len(array.rings))
    return {
        way: at_heights(image, [MARGIN_NODES + k for k in array.rings] if way.startswith("in") else rings)
        for way, image in images.items()
    }


def errors(skin: Skin, array: Array, scan: VolumeScan, images: Mapping[str, Reconstruction]) -> Iterable[Row]:
    """Errors of both ways in two regions, their difference, and the contrast of lesions in space."""
    speeds = judged(array, images)
    phantoms = [scan.phantom.at(scan.z_m[k]) for k in array.rings]
    heights = ", ".join(f"{1e3 * phantom.z_m:.1f}" for phantom in phantoms)
    detail = (
        f"{array.nodes}² by {array.heights}, {array.elements} receivers at each height, in space one in "
        f"{array.fewer} of those of other rings than the emitter's, {array.emitters} emitters at z = "
        f"{heights} mm, where the error is read; times in space on a grid {array.refinement} "
        f"times finer; water {COUPLING_MPS:g} m/s"
    )
    for region, whole in (("whole image", True), ("inside", False)):
        over = Slices(phantoms, whole)
        error = {way: over.error(levels) for way, levels in speeds.items()}
        for way, goal in GOALS.items():
            baselines = over.constants() | {STRAIGHT_RAYS: error[f"{way}, {STRAIGHT_RAYS}"]}
            target = f"R9 {skin}, {way}, {region}"
            yield Row(target, error[way], goal, "<=", "of range", detail, baselines=baselines)
            if way == "slices":
                worse = error[way] - error["in space"]
                target = f"R9 {skin}, slices less in space, {region}"
                yield Row(target, worse, 0.003, "<=", "of range", detail, error[way], baselines)
    every = [scan.phantom.at(z) for z in scan.z_m]
    levels = at_heights(images["in space"], [MARGIN_NODES + k for k in range(array.heights)])
    least = [
        least_contrast(contrasts(at, speed), SMALLEST_VOXELS) for at, speed in zip(every, levels, strict=True)
    ]
    target = f"R9 {skin}, in space, lesions of {SMALLEST_VOXELS} voxels, least part of their contrast"
    detail = f"{detail}; over all {array.heights} heights NRMSE {Slices(every).error(levels):.3f}"
    yield Row(target, float(np.nanmin(least, initial=1.0)), VISIBLE, ">=", "", detail)


def error_of_times(context: BenchmarkContext, skin: Skin, array: Array, misfit: float) -> Row:
    """Error of the times by the spacing of their grid, in a thin layer about a ring, over the misfit.

    Args:
        misfit: of the image in space, rms, s.
    """
    ring, place = array.rings[len(array.rings) // 2], len(array.rings) // 2
    scan = array.scan(skin)
    layer = replace(scan, z_m=scan.z_m[ring : ring + 1])
    emitter = int(array.emitting[place, 0]) % array.elements
    times = {
        finer: travel_times(replace(layer, refinement=finer), [emitter], context.progress)
        for finer in sorted({array.refinement, 4, array.finest})
    }
    off = {finer: float(np.sqrt(((own - times[array.finest]) ** 2).mean())) for finer, own in times.items()}
    data = float(np.sqrt((times[array.finest] ** 2).mean()))
    detail = (
        f"one emitter and its ring, against a grid {array.finest} times finer: "
        + ", ".join(f"{finer} times {1e9 * rms:.1f} ns" for finer, rms in off.items() if rms)
        + f"; rms of the data {1e9 * data:.0f} ns; misfit of the image in space {1e9 * misfit:.0f} ns"
    )
    return Row(
        f"R9 {skin}, error of the times over the misfit",
        off[array.refinement] / misfit,
        0.1,
        "<=",
        "",
        detail,
    )


def shown(skin: Skin, array: Array, scan: VolumeScan, images: Mapping[str, Reconstruction]) -> list[Panel]:
    """Phantom, straight rays, both ways, at a height below the centre."""
    place = len(array.rings) // 2 - 1
    phantom = scan.phantom.at(scan.z_m[array.rings[place]])
    speeds = judged(array, images)
    panels = [Panel(f"{skin}\nz = {1e3 * phantom.z_m:.1f} mm", phantom.speed(128, TABLE7_SIDE_M))]
    for way in (f"in space, {STRAIGHT_RAYS}", "in space", "slices"):
        error = Slices([phantom]).error([speeds[way][place]])
        panels.append(Panel(f"{way}\n{error:.4f}", speeds[way][place]))
    return panels

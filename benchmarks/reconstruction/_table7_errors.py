"""Errors of images of Table 7 slices on the 128² nodes of the phantom, and the contrast of its lesions."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from bentray_kernels.arrays import Flags, Floats
from bentray_kernels.phantoms import TABLE7_SIDE_M
from bentray_kernels.phantoms.ellipses import node_positions
from bentray_kernels.phantoms.table7 import TISSUE_MPS
from bentray_kernels.phantoms.volume import PhantomSlice
from bentray_kernels.tomography import Reconstruction
from bentray_service.cli.output.benchmark_row import BEST_CONSTANT, WATER_ALONE

from ._table7_slices import NODES

# Means over the cell of a node from this many places along each side, as the phantom itself is sampled.
PER_CELL = 4

VOXEL_M = TABLE7_SIDE_M / (NODES - 1)

# Only lesions that a slice cuts near their middle are judged: part of the radius.
NEAR_MIDDLE = 0.6


def on_phantom_nodes(image: Reconstruction, outside_mps: float) -> Floats:
    """Speed of an image in two dimensions at the nodes of the phantom: means over cells, m/s.

    Args:
        image: of a slice, on any grid.
        outside_mps: speed beyond the image, m/s.
    """
    nodes = node_positions(NODES, TABLE7_SIDE_M)
    fine = (nodes[:, None] + VOXEL_M * ((np.arange(PER_CELL) + 0.5) / PER_CELL - 0.5)).ravel()
    x, y = ((fine - origin) / image.spacing_m[0] for origin in image.origin_m[:2])
    at = np.meshgrid(x, y, indexing="ij")
    values = map_coordinates(image.speed, at, order=1, mode="constant", cval=outside_mps)
    return np.asarray(values.reshape(NODES, PER_CELL, NODES, PER_CELL).mean(axis=(1, 3)))


@dataclass(frozen=True)
class Slices:
    """Errors over several slices together, rms over the range of the phantom.

    Attributes:
        phantoms: of each slice.
        whole: whether the whole image counts; else the breast alone.
    """

    phantoms: Sequence[PhantomSlice]
    whole: bool = True

    def error(self, speeds: Iterable[Floats]) -> float:
        """Error of images on the nodes of the phantom, one of each slice."""
        return self._rms([speed - true for speed, true in zip(speeds, self._truths, strict=True)])

    def constants(self) -> dict[str, float]:
        """Errors of the best constant and of water alone."""
        values = np.concatenate([true[on] for true, on in zip(self._truths, self._regions, strict=True)])
        means = {BEST_CONSTANT: float(values.mean()), WATER_ALONE: self.phantoms[0].coupling_mps}
        return {name: self.error(np.full_like(t, mean) for t in self._truths) for name, mean in means.items()}

    @property
    def _truths(self) -> list[Floats]:
        return [phantom.speed(NODES, TABLE7_SIDE_M) for phantom in self.phantoms]

    @property
    def _regions(self) -> list[Flags]:
        inside = [phantom.inside(NODES, TABLE7_SIDE_M) for phantom in self.phantoms]
        return [np.ones_like(mask) for mask in inside] if self.whole else inside

    def _rms(self, off: Sequence[Floats]) -> float:
        low, high = self.phantoms[0].speed_range()
        values = np.concatenate([deviation[on] for deviation, on in zip(off, self._regions, strict=True)])
        return float(np.sqrt((values**2).mean())) / (high - low)


def contrasts(phantom: PhantomSlice, speed: Floats) -> dict[str, float]:
    """Contrast of each lesion of a slice over its true one, by its name and diameter in voxels.

    Args:
        phantom: of the slice.
        speed: of an image on the nodes of the phantom, m/s.
    """
    axis = node_positions(NODES, TABLE7_SIDE_M)
    true = phantom.speed(NODES, TABLE7_SIDE_M)
    contrast = {}
    for part in phantom.volume.parts[3:]:
        a, b, half_height = part.solid.semi_axes_m  # type: ignore[attr-defined]
        x, y, z = part.solid.centre_m  # type: ignore[attr-defined]
        core = part.solid.level(axis[:, None], axis[None, :], np.asarray(phantom.z_m)) <= 1.0
        if abs(phantom.z_m - z) > NEAR_MIDDLE * half_height or not core.any():
            continue
        name = f"{2.0 * max(a, b) / VOXEL_M:.0f} voxels at ({1e3 * x:.0f}, {1e3 * y:.0f}) mm"
        contrast[name] = float((speed[core] - TISSUE_MPS).mean() / (true[core] - TISSUE_MPS).mean())
    return contrast


def least_contrast(contrast: Mapping[str, float], voxels: int) -> float:
    """Least contrast of the lesions of this diameter; NaN without one."""
    return min(
        (value for name, value in contrast.items() if name.startswith(f"{voxels} ")), default=float("nan")
    )

"""Cases of usct-benchlab, from files that the user downloaded, in its geometry, units and region of errors.

The files, in one folder; either may be missing:

- ``breast_test_speed.mat`` of OpenBreastUS, MATLAB 7.3: one array of speeds in m/s, 480 by 480 pixels of
  0.5 mm, cases along its last or first axis.
- ``NBPslices2D.zip``: ``A540024479.mat``, …, MATLAB 7.3: ``sos`` in mm/µs and ``label``, 0 outside the
  breast; pixels of 0.1 mm.

The cases are those of its published panels. The files hold no traces: they are simulated here, in its ring
and water. It emits 1 MHz (OpenBreastUS) or 250 kHz and inverts 300 to 800 kHz by full waveforms; the pulse
here has a frequency that two cores can follow.
"""

import io
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.ndimage import binary_propagation, uniform_filter

from bentray_kernels.acquisition import Dataset, Truth
from bentray_kernels.arrays import Flags, Floats
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import (
    Reconstruction,
    correlation,
    mean_absolute_error,
    rmse,
    structural_similarity,
)
from bentray_service.cli.output.benchmark_context import BenchmarkContext

from ..shared._ring_scan import RingScan
from ..waves._kwave_peer import Peer

# Its ring and square, m, elements, and water, m/s. The pulse, Hz, and emissions are ours.
SIDE_M, RADIUS_M, ELEMENTS, WATER_MPS = 0.24, 0.11, 128, 1500.0
CENTRE_HZ, EMISSIONS = 3e5, 64
QUICK = (6e4, 64, 16)

OPENBREASTUS, NBP = "breast_test_speed.mat", "NBPslices2D.zip"
# Classes: heterogeneous, fibroglandular, fatty, extremely dense; its names of the cases, which count from 1.
OPENBREASTUS_CASES = {"HET test001": 0, "FIB test201": 200, "FAT test501": 500, "EXD test701": 700}
NBP_CASES = ("A540024479", "B530113966", "C520105117", "D510022534")
OPENBREASTUS_PIXEL_M, NBP_PIXEL_M = 0.5e-3, 0.1e-3
MPS_OF_MM_US = 1000.0

# Nodes along a side of the grid on which it reads errors, and its tolerance for water, m/s.
SCORED_NODES, TOLERANCE_MPS = 801, 0.1


@dataclass(frozen=True)
class PublicCase:
    """A map of speeds, centred on 0.

    Attributes:
        name: of the case.
        speed_mps: (nx, ny), m/s, as stored.
        pixel_m: distance of pixels, m.
    """

    name: str
    speed_mps: Floats
    pixel_m: float

    def at(self, nodes: int, side_m: float) -> Floats:
        """Speed at the nodes of a square, (nodes, nodes), m/s, means over about a node; water around it."""
        width = max(1, round(side_m / (nodes - 1) / self.pixel_m))
        blurred = uniform_filter(self.speed_mps, width, mode="nearest")
        lines = [self.pixel_m * (np.arange(n) - 0.5 * (n - 1)) for n in self.speed_mps.shape]
        read = RegularGridInterpolator(lines, blurred, bounds_error=False, fill_value=WATER_MPS)
        return np.asarray(read(_node_positions(nodes, side_m)))

    def truth(self) -> Truth:
        """The map as a truth."""
        origin = tuple(-0.5 * self.pixel_m * (n - 1) for n in self.speed_mps.shape)
        return Truth(self.speed_mps, (self.pixel_m,) * 2, origin)


@dataclass(frozen=True)
class Scores:
    """Errors in its tissue, on its grid: rms error of an image, and figures by name."""

    rmse: float
    figures: Mapping[str, float]


def read_cases(folder: Path) -> Iterator[PublicCase]:
    """The cases whose files are in a folder.

    Raises:
        InvalidInput: naming the file, for one of another layout, and for a folder without any.
    """
    maps, slices = folder / OPENBREASTUS, folder / NBP
    if not maps.is_file() and not slices.is_file():
        raise InvalidInput("--data", f"{folder}, without these files", f"{OPENBREASTUS} or {NBP}")
    if maps.is_file():
        yield from _openbreastus(maps)
    if slices.is_file():
        yield from _nbp(slices)


def _openbreastus(path: Path) -> Iterator[PublicCase]:
    accepted = "MATLAB 7.3 with one array of square maps in m/s"
    with _opened(path, path.name, accepted) as file:
        cubes = [item for item in file.values() if isinstance(item, h5py.Dataset) and item.ndim == 3]
        if len(cubes) != 1:
            raise InvalidInput(path.name, f"{len(cubes)} arrays of three axes", accepted)
        stored = cubes[0]
        if stored.shape[0] == stored.shape[1] != stored.shape[2]:
            axis = 2
        elif stored.shape[1] == stored.shape[2]:
            axis = 0
        else:
            raise InvalidInput(path.name, f"shape {stored.shape}", accepted)
        for name, index in OPENBREASTUS_CASES.items():
            if index < stored.shape[axis]:
                speed = np.asarray(stored[..., index] if axis == 2 else stored[index], np.float64)
                yield PublicCase(f"OpenBreastUS {name}", _speeds(path.name, speed), OPENBREASTUS_PIXEL_M)


def _nbp(path: Path) -> Iterator[PublicCase]:
    accepted = "a zip of MATLAB 7.3 files with sos in mm/us and label"
    try:
        archive = zipfile.ZipFile(path)
    except (OSError, zipfile.BadZipFile) as error:
        raise InvalidInput(path.name, str(error), accepted) from None
    with archive:
        members = {Path(name).stem: name for name in archive.namelist() if name.endswith(".mat")}
        for case in NBP_CASES:
            if case not in members:
                continue
            with _opened(io.BytesIO(archive.read(members[case])), members[case], accepted) as file:
                if "sos" not in file or "label" not in file:
                    raise InvalidInput(members[case], f"arrays {sorted(file)}", accepted)
                label = np.asarray(file["label"])
                speed = _speeds(members[case], MPS_OF_MM_US * np.asarray(file["sos"], np.float64))
            yield PublicCase(
                f"NBP {case[0]}", _centred(np.where(label > 0, speed, WATER_MPS), label > 0), NBP_PIXEL_M
            )


def _opened(source: Any, name: str, accepted: str) -> h5py.File:
    try:
        return h5py.File(source, "r")
    except OSError as error:
        raise InvalidInput(name, str(error)[:120], accepted) from None


def _speeds(name: str, speed: Floats) -> Floats:
    """The map, if it can be one of speeds in m/s."""
    low, high = float(speed.min()), float(speed.max())
    if not 1000.0 < low <= high < 3000.0:
        raise InvalidInput(name, f"values of {low:g} to {high:g} m/s", "speeds of tissue and water")
    return speed


def _centred(speed: Floats, inside: Flags) -> Floats:
    """The part with the breast in its middle, with a margin of water of a pixel."""
    window = tuple(slice(max(0, indices.min() - 1), indices.max() + 2) for indices in np.nonzero(inside))
    return np.pad(speed[window], 1, constant_values=WATER_MPS)


def benchlab_scans(context: BenchmarkContext, peer: Peer | None) -> Iterator[tuple[PublicCase, Dataset]]:
    """The cases in the folder of the context as scans of its ring, without noise, as its own.

    Args:
        context: with the folder, or None: no case.
        peer: k-Wave, or None: our simulator.
    """
    if context.data is None:
        return
    centre, elements, emissions = QUICK if context.quick else (CENTRE_HZ, ELEMENTS, EMISSIONS)
    water: dict[tuple[float, float], np.ndarray] = {}
    for case in read_cases(context.data):
        limits = (min(float(case.speed_mps.min()), WATER_MPS), max(float(case.speed_mps.max()), WATER_MPS))
        size = RingScan(SIDE_M, RADIUS_M, centre, elements, emissions, limits, WATER_MPS, peer)
        still = np.full((size.nodes, size.nodes), WATER_MPS)
        if limits not in water:
            water[limits] = size.recorded({"water": still}, context.progress)["water"]
        speed = case.at(size.nodes, SIDE_M)
        traces = size.recorded({case.name: speed}, context.progress)[case.name]
        yield case, size.dataset(traces, water[limits], speed, tissue(speed))


def tissue(truth: Floats) -> Flags:
    """Its region of errors: all but the water that is connected with the edge of the map."""
    water = np.abs(truth - WATER_MPS) <= TOLERANCE_MPS
    edge = np.zeros_like(water)
    edge[[0, -1]], edge[:, [0, -1]] = water[[0, -1]], water[:, [0, -1]]
    return np.asarray(~binary_propagation(edge, mask=water))


def scores(image: Reconstruction | float, case: PublicCase) -> Scores:
    """Errors of an image, or of a constant, in the tissue at the nodes of its grid of 801 by 801.

    Its SSIM uses windows of 7 by 7 nodes within the tissue and the range of the whole truth, as ours does.
    """
    points = _node_positions(SCORED_NODES, SIDE_M)
    true = case.at(SCORED_NODES, SIDE_M)
    region = tissue(true)
    if isinstance(image, Reconstruction):
        lines = [
            start + step * np.arange(n)
            for start, step, n in zip(image.origin_m, image.spacing_m, image.speed.shape, strict=True)
        ]
        read = RegularGridInterpolator(
            lines, image.speed, bounds_error=False, fill_value=image.water_speed_mps
        )
        speed = np.asarray(read(points))
    else:
        speed = np.full_like(true, image)
    figures = {
        "RMSE": rmse(speed, true, region),
        "MAE": mean_absolute_error(speed, true, region),
        "SSIM": structural_similarity(speed, true, region, float(np.ptp(true))),
        "PCC": correlation(speed, true, region),
    }
    return Scores(figures["RMSE"], figures)


def mean_speed(case: PublicCase) -> float:
    """Mean speed of the tissue, the best constant, m/s."""
    true = case.at(SCORED_NODES, SIDE_M)
    return float(true[tissue(true)].mean())


def _node_positions(nodes: int, side_m: float) -> Floats:
    """Nodes of a square centred on 0, (nodes, nodes, 2), m."""
    line = np.linspace(-0.5 * side_m, 0.5 * side_m, nodes)
    return np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1)

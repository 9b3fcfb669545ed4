"""A truth to compare a result with, from a file: of a dataset, a result, or an array of speeds."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.acquisition import Truth
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Reconstruction

from .damage import rejecting_damage
from .dataset.read import FORMAT as DATASET
from .dataset.read import dataset_of
from .hdf5_reading import SIGNATURE, opened
from .quantities import FORMAT as RECONSTRUCTION
from .reconstruction import reconstruction_in
from .volume import check_shape
from .volume_axes import PositionedImage, check_aligned
from .volume_formats import import_volume, positioned_image

ACCEPTED = "a dataset with a truth, a reconstruction, or speeds in m/s as NumPy, NRRD, NIfTI or a volume"
# Below this a median is no speed of tissue in m/s, but one in mm/us or km/s.
LEAST_MPS = 100.0
NUMPY = b"\x93NUMPY"


class KnownTruth(NamedTuple):
    """A truth, and the region of interest of its file, on the grid of the truth, if it has one."""

    truth: Truth
    roi: NDArray[np.bool_] | None = None


def read_truth(path: Path, image: Reconstruction, spacing_m: Sequence[float] | None = None) -> KnownTruth:
    """Read a truth for an image.

    A dataset has its own truth and region. A reconstruction is taken as true, speed and attenuation. Other
    files hold speeds in m/s: a volume in a format of ``import_volume``, or a slice as NumPy, NRRD or NIfTI. A
    NumPy array has no positions: without ``spacing_m`` it is on the nodes of the image, else centred on 0.

    Args:
        path: of the file.
        image: what it is for.
        spacing_m: of the nodes of a NumPy file, m: one distance, or one per axis.

    Raises:
        InvalidInput: naming ``file`` or the field that is missing or wrong; ``spacing_m`` for a NumPy array
            of another shape than the image without it, and for a file that states its positions.
    """
    try:
        with path.open("rb") as file:
            start = file.read(540)
            file.seek(0)
            stored = positioned_image(file, start, least=1)
    except OSError as error:
        raise InvalidInput("truth", f"{path} ({error.strerror or error})", ACCEPTED) from None
    if start.startswith(NUMPY):
        return KnownTruth(_on_nodes(_array(path), image, spacing_m))
    if spacing_m is not None:
        raise InvalidInput("spacing", list(spacing_m), "nothing: only NumPy files do not state positions")
    if start.startswith(SIGNATURE):
        truth = _hdf5(path)
        if truth is not None:
            return truth
    if stored is None:
        volume = import_volume(path)
        stored = PositionedImage(volume.values, volume.grid, volume.title)
    return KnownTruth(_positioned_truth(stored))


def _positioned_truth(stored: PositionedImage) -> Truth:
    """Speeds of an image with positions; one slice across z becomes a plane."""
    values, grid, _ = stored
    check_aligned(grid, "truth", "axes along x, y and z; resample the truth on such a grid")
    if values.shape[2] == 1:
        return _truth(values[..., 0], grid.spacing_m[:2], grid.origin_m[:2])
    check_shape("truth", values.shape)
    return _truth(values, grid.spacing_m, grid.origin_m)


def _truth(
    values: NDArray[Any],
    spacing_m: Sequence[float],
    origin_m: Sequence[float],
    attenuation: NDArray[np.float64] | None = None,
) -> Truth:
    axes = ",".join("xyz"[: values.ndim])
    speed = np.asarray(values, np.float64)
    if not float(np.nanmedian(speed)) >= LEAST_MPS:
        raise InvalidInput("truth", f"a median of {np.nanmedian(speed):g}", "speeds in m/s")
    return Truth(speed, tuple(map(float, spacing_m)), tuple(map(float, origin_m)), attenuation, axes)


def _array(path: Path) -> NDArray[Any]:
    with rejecting_damage("truth", "a whole NumPy file of real numbers"):
        values = np.load(path, allow_pickle=False)
    if values.dtype.kind not in "uif" or values.ndim not in (2, 3):
        given = f"{values.dtype} of shape {values.shape}"
        raise InvalidInput("truth", given, "real numbers, (nx, ny) or (nx, ny, nz)")
    return np.asarray(values)


def _on_nodes(values: NDArray[Any], image: Reconstruction, spacing_m: Sequence[float] | None) -> Truth:
    """Values of a file without positions; see ``read_truth``."""
    if spacing_m is None:
        if values.shape != image.speed.shape:
            given = f"none, for {' x '.join(map(str, values.shape))} nodes"
            size = " x ".join(map(str, image.speed.shape))
            raise InvalidInput("spacing", given, f"the node spacing in m, or an array of {size} nodes")
        return _truth(values, image.spacing_m, image.origin_m)
    steps = tuple(spacing_m) * (values.ndim if len(spacing_m) == 1 else 1)
    if len(steps) != values.ndim:
        raise InvalidInput("spacing", list(spacing_m), f"one distance in m, or {values.ndim}")
    origin = [-0.5 * step * (n - 1) for step, n in zip(steps, values.shape, strict=True)]
    return _truth(values, steps, origin)


def _hdf5(path: Path) -> KnownTruth | None:
    """The truth in a dataset or a reconstruction; None for other files, which ``import_volume`` reads."""
    with opened(path) as reader:
        kind = reader.text("", "format")
        if kind == DATASET:
            dataset = dataset_of(reader, None)
            if dataset.truth is None:
                raise InvalidInput("truth", f"{path.name}, a dataset without truth", ACCEPTED)
            return KnownTruth(dataset.truth, dataset.roi)
        if kind == RECONSTRUCTION:
            own = reconstruction_in(reader)
            return KnownTruth(_truth(own.speed, own.spacing_m, own.origin_m, own.attenuation))
    return None

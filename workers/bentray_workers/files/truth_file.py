"""A truth to compare a result with, from a file: of a dataset, a result, or an array of speeds."""

from __future__ import annotations

import gzip
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.acquisition import Truth
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Reconstruction

from .bounded_reading import UNITS_M
from .damage import rejecting_damage
from .dataset.format import FORMAT as DATASET
from .dataset.read import read_dataset
from .hdf5_reading import SIGNATURE, Limits, opened
from .reconstruction import read_reconstruction
from .reconstruction_format import FORMAT as RECONSTRUCTION
from .volume_formats import import_volume

ACCEPTED = "a dataset with a truth, a reconstruction, or speeds in m/s as NumPy, NRRD, NIfTI or a volume"
# Below this a median is no speed of tissue in m/s, but one in mm/us or km/s.
LEAST_MPS = 100.0
NUMPY, GZIP = b"\x93NUMPY", b"\x1f\x8b"


class KnownTruth(NamedTuple):
    """A truth, and the region of interest of its file, on the grid of the truth, if it has one."""

    truth: Truth
    roi: NDArray[np.bool_] | None = None


def read_truth(path: Path, image: Reconstruction, spacing_m: Sequence[float] | None = None) -> KnownTruth:
    """Read a truth for an image.

    A dataset has its own truth and region. A reconstruction is taken as true, speed and attenuation. Other
    files hold speeds in m/s: a volume in a format of ``import_volume``, or a slice as NumPy or NIfTI. A NumPy
    array has no positions: without ``spacing_m`` it is on the nodes of the image, else centred on 0.

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
    except OSError as error:
        raise InvalidInput("truth", f"{path} ({error.strerror or error})", ACCEPTED) from None
    if start.startswith(NUMPY):
        return KnownTruth(_on_nodes(_array(path), image, spacing_m))
    if spacing_m is not None:
        raise InvalidInput("spacing", list(spacing_m), "nothing: only NumPy files do not state positions")
    if start.startswith(SIGNATURE):
        known = _hdf5(path)
        if known is not None:
            return known
    elif start.startswith(GZIP) or start[344:348] == b"n+1\0" or start[4:8] == b"n+2\0":
        plane = _nifti_slice(path)
        if plane is not None:
            return KnownTruth(plane)
    volume = import_volume(path)
    return KnownTruth(_truth(volume.values, volume.spacing_m, volume.origin_m))


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
        found = f"{values.dtype} of shape {values.shape}"
        raise InvalidInput("truth", found, "real numbers, (nx, ny) or (nx, ny, nz)")
    return np.asarray(values)


def _on_nodes(values: NDArray[Any], image: Reconstruction, spacing_m: Sequence[float] | None) -> Truth:
    """Values of a file without positions; see ``read_truth``."""
    if spacing_m is None:
        if values.shape != image.speed.shape:
            found = f"none, for {' x '.join(map(str, values.shape))} nodes"
            size = " x ".join(map(str, image.speed.shape))
            raise InvalidInput("spacing", found, f"the node spacing in m, or an array of {size} nodes")
        return _truth(values, image.spacing_m, image.origin_m)
    steps = tuple(spacing_m) * (values.ndim if len(spacing_m) == 1 else 1)
    if len(steps) != values.ndim:
        raise InvalidInput("spacing", list(spacing_m), f"one distance in m, or {values.ndim}")
    origin = [-0.5 * step * (n - 1) for step, n in zip(steps, values.shape, strict=True)]
    return _truth(values, steps, origin)


def _hdf5(path: Path) -> KnownTruth | None:
    """The truth in a dataset or a reconstruction; None for other files, which ``import_volume`` reads."""
    with opened(path, Limits()) as reader:
        kind = reader.text("", "format")
    if kind == DATASET:
        dataset = read_dataset(path, traces=False)
        if dataset.truth is None:
            raise InvalidInput("truth", f"{path.name}, a dataset without truth", ACCEPTED)
        return KnownTruth(dataset.truth, dataset.roi)
    if kind == RECONSTRUCTION:
        own = read_reconstruction(path)
        return KnownTruth(_truth(own.speed, own.spacing_m, own.origin_m, own.attenuation))
    return None


def _nifti_slice(path: Path) -> Truth | None:
    """The speeds of a NIfTI file with one slice; None for volumes, which ``import_volume`` reads."""
    import nibabel

    with rejecting_damage("truth", "a whole NIfTI file of one part"):
        content = path.read_bytes()
        if content.startswith(GZIP):
            content = gzip.decompress(content)
        image: Any = (nibabel.Nifti2Image if content[4:8] == b"n+2\0" else nibabel.Nifti1Image).from_bytes(
            content
        )
        shape = image.shape
        if len(shape) < 2 or any(n != 1 for n in shape[2:]):
            return None
        affine = np.asarray(image.affine)
        plane = affine[:2, :2]
        if not (np.diag(plane) > 0.0).all() or (plane != np.diag(np.diag(plane))).any():
            raise InvalidInput("truth", "a slice whose axes are turned", "a slice along x and y")
        unit = image.header.get_xyzt_units()[0]
        scale = UNITS_M["mm" if unit == "unknown" else unit]
        values = np.asarray(image.get_fdata()).reshape(shape[:2])
    return _truth(values, (scale * np.diag(plane)).tolist(), (scale * affine[:2, 3]).tolist())

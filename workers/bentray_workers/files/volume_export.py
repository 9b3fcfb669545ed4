"""Export of volumes to other file formats."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput

from .atomic import atomic_replace
from .hdf5_reading import Limits, opened
from .mat_writing import write_mat
from .metaimage_writing import write_metaimage
from .nifti_writing import write_nifti
from .reconstruction import IMAGES, read_reconstruction
from .volume import FORMAT, read_volume


@dataclass(frozen=True)
class Content:
    """Content of the file of a volume.

    Attributes:
        values: (nx, ny[, nz]): the speed of a reconstruction, m/s, or the values of an upload.
        spacing_m, origin_m: per axis, m; NaN for uneven heights.
        title: of the volume.
        images: all arrays by name, including the values.
    """

    values: NDArray[Any]
    spacing_m: Sequence[float]
    origin_m: Sequence[float]
    title: str
    images: Mapping[str, NDArray[Any]]


@dataclass(frozen=True)
class Format:
    """A file format: extension, media type and writer."""

    extension: str
    media_type: str
    write: Callable[[Path, Content], None]


# Size of a number, and of headers.
NUMBER_BYTES, HEADER_BYTES = 8, 64 * 2**10


def largest_bytes(shape: Sequence[int], *, uploaded: bool) -> int:
    """Largest size of a volume of this shape in any of the formats, bytes."""
    images = 1 if uploaded else len(IMAGES)
    return images * NUMBER_BYTES * math.prod(shape) + HEADER_BYTES


def export_volume(volume: Path, *, target: Path, name: str) -> None:
    """Task: write a volume or reconstruction file in another format.

    Args:
        volume: its file.
        target: the exported file, replaced atomically.
        name: a key of ``FORMATS``.

    Raises:
        InvalidInput: naming ``volume``, for content that the format cannot store, or a deleted volume.
        OSError: where the folder cannot be written to or the disk is full.
    """
    with opened(volume, Limits()) as reader:
        uploaded = reader.text("", "format") == FORMAT
    try:
        FORMATS[name].write(target, _uploaded(volume) if uploaded else _reconstructed(volume))
    except FileNotFoundError:
        # Deleting a volume removes its exports, also unfinished ones.
        if not target.parent.is_dir():
            raise
        raise InvalidInput("volume", "one that was deleted during its export", "one that stays") from None


def _uploaded(volume: Path) -> Content:
    own = read_volume(volume)
    return Content(own.values, own.spacing_m, own.origin_m, own.title, {"values": own.values})


def _reconstructed(volume: Path) -> Content:
    own = read_reconstruction(volume)
    held = {place: getattr(own, name) for name, place in IMAGES.items()}
    images = {place: image for place, image in held.items() if image is not None}
    return Content(own.speed, own.spacing_m, own.origin_m, "Speed of sound, m/s", images)


def _npy(target: Path, content: Content) -> None:
    with atomic_replace(target) as partial, partial.open("wb") as file:
        np.save(file, np.ascontiguousarray(content.values), allow_pickle=False)


def _on_grid(write: Callable[..., None]) -> Callable[[Path, Content], None]:
    """Use a writer that takes values and grid."""
    return lambda target, content: write(
        target, content.values, content.spacing_m, content.origin_m, content.title
    )


def _mat(target: Path, content: Content) -> None:
    grid = {"spacing_m": np.array(content.spacing_m), "origin_m": np.array(content.origin_m)}
    axes = ",".join("xyz"[: content.values.ndim])
    write_mat(target, {**content.images, **grid, "axes": axes, "title": content.title})


FORMATS: Mapping[str, Format] = MappingProxyType(
    {
        "npy": Format("npy", "application/octet-stream", _npy),
        "nifti": Format("nii", "application/octet-stream", _on_grid(write_nifti)),
        "metaimage": Format("mha", "application/octet-stream", _on_grid(write_metaimage)),
        "mat": Format("mat", "application/x-matlab-data", _mat),
    }
)

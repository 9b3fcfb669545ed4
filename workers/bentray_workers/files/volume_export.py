"""Export of volumes to other file formats."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput
from bentray_kernels.limits import FREQUENCY_HZ
from bentray_kernels.tomography import Reconstruction

from .atomic import atomic_replace
from .export.dicom_writing import write_dicom
from .export.mat_writing import write_mat
from .export.metaimage_writing import write_metaimage
from .export.nifti_writing import write_nifti
from .export.nrrd_writing import write_nrrd
from .export.ome_zarr_writing import write_ome_zarr
from .export.vti_writing import write_vti
from .hdf5_reading import Limits, opened
from .quantities import IMAGES, QUANTITIES, REFLECTION
from .reconstruction import read_reconstruction
from .volume import FORMAT, Volume, read_volume
from .volume_axes import Grid

ATTENUATION, ATTENUATION_DB = IMAGES["attenuation"], "attenuation_db_cm_mhz"
UNITS = {**{quantity.array: quantity.unit for quantity in QUANTITIES.values()}, ATTENUATION_DB: "dB/(cm.MHz)"}
TITLES = {
    **{quantity.array: quantity.label[0].upper() + quantity.label[1:] for quantity in QUANTITIES.values()},
    ATTENUATION_DB: "Attenuation (dB/(cm MHz))",
}
# Formats with one image.
SINGLE = ("npy", "nifti", "metaimage", "nrrd")
ATTENUATION_UNITS = ("Np/m", "dB/cm/MHz")
# Entry of the provenance with the frequency of the attenuation.
FREQUENCY = "frequency_hz"
DB_CM_OF_NP_M = 20.0 / math.log(10.0) / 100.0


@dataclass(frozen=True)
class Selection:
    """The part of a reconstruction to export.

    Attributes:
        quantity: of formats with one image, of ``QUANTITIES``; of formats with all images ``reflection``
            selects that image, which has a grid of its own.
        attenuation: unit of the attenuation, of ``ATTENUATION_UNITS``.
        frequency_hz: for dB/cm/MHz; None: that of the scan.

    Raises:
        InvalidInput: naming the first invalid field.
    """

    quantity: str = "speed"
    attenuation: str = "Np/m"
    frequency_hz: float | None = None

    def __post_init__(self) -> None:
        for name, value, accepted in (
            ("quantity", self.quantity, QUANTITIES),
            ("attenuation", self.attenuation, ATTENUATION_UNITS),
        ):
            if value not in accepted:
                raise InvalidInput(name, repr(value)[:40], "one of " + ", ".join(accepted))
        if self.frequency_hz is not None:
            FREQUENCY_HZ.check("frequency", self.frequency_hz)


@dataclass(frozen=True)
class Content:
    """Content of the file of a volume: one grid.

    Attributes:
        values: (nx, ny[, nz]): the selected quantity of a reconstruction, or the values of an upload.
        grid: positions of the nodes.
        title: of the volume.
        images: all arrays on this grid by name, including the values.
        seconds: time of the file, s since 1970.
    """

    values: NDArray[Any]
    grid: Grid
    title: str
    images: Mapping[str, NDArray[Any]]
    seconds: float = 0.0


@dataclass(frozen=True)
class Format:
    """A file format: extension, media type and writer.

    Attributes:
        copies: memory while it is written, in sizes of the volume as it is read (measured).
        library_bytes: memory of the libraries that it is written by.
    """

    extension: str
    media_type: str
    write: Callable[[Path, Content], None]
    copies: float = 2.0
    library_bytes: int = 0


# Of what is written here; a service sends no stored export of another one. 2: positions in RAS or LPS.
REVISION = 2
# Size of a number, and of headers.
NUMBER_BYTES, HEADER_BYTES = 8, 64 * 2**10
# Of the description of a slice in DICOM, and of a chunk of OME-Zarr.
SLICE_BYTES = 8 * 2**10


def largest_bytes(shape: Sequence[int], *, uploaded: bool) -> int:
    """Largest size of a volume of this shape in any of the formats, bytes."""
    images = 1 if uploaded else len(IMAGES)
    return images * (NUMBER_BYTES * math.prod(shape) + SLICE_BYTES * shape[-1]) + HEADER_BYTES


def export_volume(volume: Path, *, target: Path, name: str, selection: Selection | None = None) -> None:
    """Task: write a volume or reconstruction file in another format.

    Args:
        volume: its file.
        target: the exported file, replaced atomically.
        name: a key of ``FORMATS``.
        selection: of quantity and unit; None: the speed, and Np/m.

    Raises:
        InvalidInput: naming ``volume``, for content that the format cannot store, or a deleted volume; naming
            the field of the selection, for a quantity that the volume does not have.
        OSError: where the folder cannot be written to or the disk is full.
    """
    image = read_image(volume)
    try:
        export_image(image, target=target, name=name, selection=selection, seconds=volume.stat().st_mtime)
    except FileNotFoundError:
        # Deleting a volume removes its file and its exports, also unfinished ones.
        if not target.parent.is_dir():
            raise
        raise InvalidInput("volume", "one that was deleted during its export", "one that stays") from None


def read_image(path: Path) -> Reconstruction | Volume:
    """Read the file of a reconstruction or of a volume.

    Raises:
        InvalidInput: naming the first field that is missing or wrong, as ``read_dataset`` does.
    """
    with opened(path, Limits()) as reader:
        uploaded = reader.text("", "format") == FORMAT
    return read_volume(path) if uploaded else read_reconstruction(path)


def export_image(
    image: Reconstruction | Volume,
    *,
    target: Path,
    name: str,
    selection: Selection | None = None,
    seconds: float = 0.0,
) -> None:
    """Write a reconstruction or a volume in another format.

    Args:
        image: what to write.
        target: the exported file, replaced atomically.
        name: a key of ``FORMATS``.
        selection: of quantity and unit; None: the speed, and Np/m.
        seconds: time of the image, s since 1970.

    Raises:
        InvalidInput: naming ``volume``, for content that the format cannot store; naming the field of the
            selection, for a quantity that the image does not have.
        OSError: where the folder cannot be written to or the disk is full.
    """
    chosen = selection or Selection()
    if isinstance(image, Volume):
        if chosen != Selection():
            given = f"{chosen.quantity}, {chosen.attenuation}"
            raise InvalidInput("quantity", given, "none: an uploaded volume has values only")
        images = {"values": image.values}
        content = Content(image.values, image.grid, image.title, images, seconds)
    else:
        content = _reconstructed(image, chosen, seconds)
    FORMATS[name].write(target, content)


def _reconstructed(own: Reconstruction, chosen: Selection, seconds: float) -> Content:
    held = {path: getattr(own, name) for name, path in IMAGES.items()}
    images = {path: image for path, image in held.items() if image is not None}
    if chosen.attenuation != "Np/m" and ATTENUATION in images:
        frequency = _frequency(own.provenance, chosen)
        factor = DB_CM_OF_NP_M / (frequency * 1e-6)
        images = {
            ATTENUATION_DB if name == ATTENUATION else name: factor * image if name == ATTENUATION else image
            for name, image in images.items()
        }
    if chosen.quantity == "reflection" and own.reflection is not None:
        image = own.reflection
        return Content(
            image.db,
            Grid(image.spacing_m, image.origin_m),
            TITLES[REFLECTION],
            {REFLECTION: image.db},
            seconds,
        )
    selected = next((name for name in images if name.startswith(chosen.quantity)), None)
    if selected is None:
        present = ", ".join(name for name in QUANTITIES if own.image(name) is not None)
        raise InvalidInput("quantity", f"{chosen.quantity} of a result without it", present)
    grid = Grid(own.spacing_m, own.origin_m)
    return Content(images[selected], grid, TITLES[selected], images, seconds)


def _frequency(provenance: Mapping[str, str], chosen: Selection) -> float:
    """The frequency that an attenuation in dB/cm/MHz refers to, Hz."""
    if chosen.frequency_hz is not None:
        return chosen.frequency_hz
    try:
        frequency = float(provenance[FREQUENCY])
        FREQUENCY_HZ.check(FREQUENCY, frequency)
    except (KeyError, ValueError):
        accepted = "Np/m, or a frequency: the result states none"
        raise InvalidInput("attenuation", repr(chosen.attenuation), accepted) from None
    return frequency


def _npy(target: Path, content: Content) -> None:
    with atomic_replace(target) as partial, partial.open("wb") as file:
        np.save(file, np.ascontiguousarray(content.values), allow_pickle=False)


def _on_grid(write: Callable[..., None]) -> Callable[[Path, Content], None]:
    """Use a writer that takes values and grid."""
    return lambda target, content: write(target, content.values, content.grid, content.title)


def _mat(target: Path, content: Content) -> None:
    own = content.grid
    grid = {"spacing_m": np.array(own.spacing_m), "origin_m": np.array(own.origin_m)}
    if content.values.ndim == 3:
        grid["direction"] = own.direction
    axes = ",".join("xyz"[: content.values.ndim])
    write_mat(target, {**content.images, **grid, "axes": axes, "title": content.title})


def _vti(target: Path, content: Content) -> None:
    active = next(name for name, image in content.images.items() if image is content.values)
    write_vti(target, content.images, content.grid, active)


def _ome_zarr(target: Path, content: Content) -> None:
    write_ome_zarr(target, content.images, UNITS, content.grid, content.title)


def _dicom(target: Path, content: Content) -> None:
    write_dicom(
        target,
        content.images,
        content.grid,
        content.title,
        version("bentray"),
        content.seconds,
    )


FORMATS: Mapping[str, Format] = MappingProxyType(
    {
        "npy": Format("npy", "application/octet-stream", _npy),
        "nifti": Format("nii", "application/octet-stream", _on_grid(write_nifti)),
        "metaimage": Format("mha", "application/octet-stream", _on_grid(write_metaimage)),
        "nrrd": Format("nrrd", "application/octet-stream", _on_grid(write_nrrd)),
        "mat": Format("mat", "application/x-matlab-data", _mat),
        "vti": Format("vti", "application/octet-stream", _vti),
        "ome-zarr": Format("ome.zarr.zip", "application/zip", _ome_zarr, library_bytes=96 * 2**20),
        "dicom": Format("dcm", "application/dicom", _dicom, 3.0, 160 * 2**20),
    }
)

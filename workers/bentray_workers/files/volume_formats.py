"""Import of untrusted volumes in all accepted formats, detected by content."""

import gzip
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput

from .bounded_reading import LARGEST_BYTES, ShapeCheck, any_shape, declared
from .damage import first_bytes, rejecting_damage
from .hdf5_reading import SIGNATURE, Limits, opened, printable
from .nifti_reading import nifti_image
from .npy_headers import read_header
from .npz import START as NPZ
from .npz import WHOLE, Npz
from .nrrd_reading import nrrd_image
from .quantities import FORMAT as RECONSTRUCTION
from .volume import FORMAT, Volume, volume_in
from .volume_axes import PositionedImage

ACCEPTED = "a volume as NumPy (.npy, .npz), NRRD, NIfTI or HDF5 of Bentray, or raw bytes with shape and dtype"

# Default spacing, m.
SPACING_M = 1e-3

# Little-endian, and with "-be" big-endian.
RAW_TYPES = {"uint8": np.dtype("u1"), "int8": np.dtype("i1")} | {
    name + suffix: np.dtype(order + code)
    for name, code in {"uint16": "u2", "int16": "i2", "int32": "i4", "float32": "f4", "float64": "f8"}.items()
    for suffix, order in (("", "<"), ("-be", ">"))
}


@dataclass(frozen=True)
class VolumeMetadata:
    """Properties given by the user that are not in the file.

    Attributes:
        title: replaces that of the file.
        spacing_m: one distance or three, m; for NumPy and raw files only.
        shape: (nx, ny, nz) of raw bytes, x varies fastest.
        dtype: of raw bytes, a key of ``RAW_TYPES``.
    """

    title: str = ""
    spacing_m: Sequence[float] | None = None
    shape: Sequence[int] | None = None
    dtype: str | None = None


def import_volume(path: Path, given: VolumeMetadata | None = None, check: ShapeCheck = any_shape) -> Volume:
    """Read a volume in any of the formats.

    Axes keep the order of the file, x first; those of NIfTI and anatomical NRRD go to the right, front and
    up (``nifti_image``, ``nrrd_image``). Lengths in mm become m. A reconstruction becomes its speed, m/s.

    Args:
        path: of the file.
        given: properties that are not in the file.
        check: of the shape, called before the values are read.

    Raises:
        InvalidInput: from ``check``, for other formats, more than ``LARGEST_BYTES``, values that are not real
            and finite or that float32 cannot distinguish, and uneven slices.
    """
    given = given or VolumeMetadata()
    try:
        with path.open("rb") as file:
            start = file.read(540)
            file.seek(0)
            volume = _read(path, file, start, given, check)
    except OSError as error:
        raise InvalidInput("file", f"{path.name}: {error.strerror or error}", ACCEPTED) from None
    return replace(volume, title=printable(given.title)[:200]) if given.title else volume


def _read(path: Path, file: IO[bytes], start: bytes, given: VolumeMetadata, check: ShapeCheck) -> Volume:
    if given.shape is not None or given.dtype is not None:
        return _raw(path, given, check)
    if start.startswith(b"\x93NUMPY"):
        return _numpy(path, file, given, check)
    if start.startswith(NPZ):
        return Volume.from_values(_npz(file, check), _spacing(given))
    if given.spacing_m is not None:
        raise InvalidInput(
            "spacing_m", given.spacing_m, "nothing: this file contains it, or has no known format"
        )
    if start.startswith(SIGNATURE):
        return _hdf5(path, check)
    image = positioned_image(file, start, check)
    if image is not None:
        return Volume.from_image(image)
    content = "an empty file" if not start else f"a file of another kind ({first_bytes(start)})"
    raise InvalidInput("file", content, ACCEPTED)


def positioned_image(
    file: IO[bytes], start: bytes, check: ShapeCheck = any_shape, least: int = 2
) -> PositionedImage | None:
    """The image of an NRRD or NIfTI file; None for other files.

    Args:
        file: open, at its start.
        start: its first 540 bytes.
        check: of the shape, called before the values are read.
        least: nodes along each axis; 1 accepts planes.

    Raises:
        InvalidInput: as ``import_volume``.
    """
    if start.startswith(b"NRRD000"):
        return nrrd_image(file, check, least)
    if start.startswith(b"\x1f\x8b"):
        with rejecting_damage("file", "a whole NIfTI file packed with gzip"), gzip.open(file) as unpacked:
            return nifti_image(unpacked, check, least)
    if start[344:348] == b"n+1\0" or start[4:8] == b"n+2\0":
        return nifti_image(file, check, least)
    return None


def _raw(path: Path, given: VolumeMetadata, check: ShapeCheck) -> Volume:
    if given.shape is None or given.dtype is None:
        missing = "shape" if given.shape is None else "dtype"
        raise InvalidInput(missing, "nothing", "both shape and dtype for raw bytes")
    if given.dtype not in RAW_TYPES:
        raise InvalidInput("dtype", repr(given.dtype), "one of " + ", ".join(RAW_TYPES))
    dtype, size = RAW_TYPES[given.dtype], path.stat().st_size
    count = declared("shape", given.shape, dtype, check)
    if size != count:
        raise InvalidInput("file", f"{size} bytes", f"{count} bytes, as shape and dtype say")
    values = np.memmap(path, dtype, "r", shape=tuple(given.shape), order="F")
    return Volume.from_values(values, _spacing(given))


def _numpy(path: Path, file: IO[bytes], given: VolumeMetadata, check: ShapeCheck) -> Volume:
    with rejecting_damage("file", "a whole NumPy file of numbers"):
        shape, columns_first, dtype = read_header(file)
        count = declared("values", shape, dtype, check)
        left = path.stat().st_size - file.tell()
        if left < count:
            raise InvalidInput("file", f"{left} bytes of values", f"{count}, as its header says")
        values = np.memmap(path, dtype, "r", file.tell(), shape, "F" if columns_first else "C")
        return Volume.from_values(values, _spacing(given))


def _npz(file: IO[bytes], check: ShapeCheck) -> NDArray[Any]:
    """The 3-D array of an archive; other arrays, as of a spacing, are not read."""
    archive = Npz(file)
    headers = {name: archive.header(name) for name in archive.names()}
    volumes = [name for name, (shape, _) in headers.items() if len(shape) == 3]
    if len(volumes) != 1:
        shapes = ", ".join(str(shape) for shape, _ in headers.values())[:200]
        found = f"{len(volumes)} arrays with three dimensions (shapes {shapes or 'none'})"
        raise InvalidInput("file", found, f"{WHOLE}, one of them with three dimensions")
    declared("values", *headers[volumes[0]], check)
    return archive.whole(volumes[0])


def _hdf5(path: Path, check: ShapeCheck) -> Volume:
    with opened(path, Limits(total_bytes=LARGEST_BYTES)) as reader:
        kind = reader.text("", "format")
        array_path = "values" if kind == FORMAT else "speed_mps"
        values = reader.checked(array_path, "buif", "(nx, ny, nz) numbers")
        if values is not None:
            check(values.shape)
        if kind == FORMAT:
            return volume_in(reader)
        if kind != RECONSTRUCTION:
            raise InvalidInput("@format", repr(kind), f'"{FORMAT}" or "{RECONSTRUCTION}"')
        # Imported here, since it loads compiled code and each upload starts a process.
        from .reconstruction import reconstruction_in

        result = reconstruction_in(reader)
    return Volume.from_values(result.speed, result.spacing_m, result.origin_m, "Sound speed (m/s)")


def _spacing(given: VolumeMetadata) -> tuple[float, ...]:
    steps = tuple(given.spacing_m or (SPACING_M,))
    return steps * 3 if len(steps) == 1 else steps

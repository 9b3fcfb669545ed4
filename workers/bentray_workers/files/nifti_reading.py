"""Reading single-file NIfTI-1 and -2: the header by nibabel, the values here, within bounds."""

import logging
from typing import Any

import numpy as np

from bentray_kernels.arrays import Floats
from bentray_kernels.errors import InvalidInput

from .bounded_reading import (
    LONGEST_TAIL,
    UNITS_M,
    ShapeCheck,
    any_shape,
    at_end,
    declared,
    whole,
)
from .damage import rejecting_damage
from .npy_headers import LONGEST_HEADER
from .volume_axes import PositionedImage, reorient

# Discards messages of nibabel about a header: the exception has the same text.
_silent = logging.Logger("nibabel checks, silent", logging.CRITICAL + 1)


def nifti_image(file: Any, check: ShapeCheck = any_shape, least: int = 2) -> PositionedImage:
    """The image in an open, uncompressed file, with axes to the right, front and up of the body.

    Axes are permuted and flipped to the nearest orientation (``reorient``). A file without directions (both
    codes 0) is read as it is stored.

    Args:
        file: at its beginning. It is read to its end, so that the check sum of a compressed file is verified.
        check: called with the shape in the file before the values are read.
        least: nodes along each axis; 1 accepts planes.

    Raises:
        InvalidInput: for other files, and for axes that are not orthogonal.
    """
    from nibabel.nifti1 import Nifti1Header
    from nibabel.nifti2 import Nifti2Header
    from nibabel.spatialimages import HeaderDataError

    with rejecting_damage("file", "a whole NIfTI file of one part"):
        start = file.read(540)
        kind, size = (Nifti2Header, 540) if start[4:8] == b"n+2\0" else (Nifti1Header, 348)
        if b"n+" not in (start[344:346], start[4:6]):
            raise InvalidInput("file", f"packed content of another kind ({start[:8]!r})", "NIfTI")
        try:
            header: Any = kind(start[:size], check=False)
            _check_numbers(header)
            header.check_fix(_silent)
            dtype, shape = header.get_data_dtype(), tuple(int(n) for n in header.get_data_shape())
            slope, intercept = header.get_slope_inter()
            affine, unit = _affine(header), header.get_xyzt_units()[0]
        except HeaderDataError as error:
            raise InvalidInput("file", f"a damaged NIfTI header ({error})", "a whole NIfTI file") from None
        # A single volume often has a fourth axis of length 1.
        while len(shape) > 3 and shape[-1] == 1:
            shape = shape[:-1]
        if least == 1:
            shape = (*shape, 1) if len(shape) == 2 else shape
        count = declared("dim", shape, dtype, check, least)
        offset = int(header["vox_offset"])
        if not size <= offset <= LONGEST_HEADER:
            raise InvalidInput("vox_offset", offset, f"{size} to {LONGEST_HEADER} bytes")
        file.seek(offset)
        values = np.frombuffer(whole(file, count), dtype).reshape(shape, order="F")
        at_end(file, LONGEST_TAIL)
        if (slope or 1.0, intercept or 0.0) != (1.0, 0.0):
            with np.errstate(over="ignore", invalid="ignore"):
                values = values * np.float32(slope) + np.float32(intercept)
        title = bytes(header["descrip"].item()).decode("utf-8", "replace")
        affine[:3] *= UNITS_M["mm" if unit == "unknown" else unit]
        return PositionedImage(*reorient(values, affine, "affine"), title)


def _check_numbers(header: Any) -> None:
    """Reject numbers that nibabel would correct by guesses."""
    for name in ("scl_slope", "scl_inter"):
        # Nibabel writes NaN for an absent value.
        if np.isinf(header[name]):
            raise InvalidInput(name, float(header[name]), "a finite number")
    steps = header["pixdim"][1:4]
    placed = header["sform_code"] != 0 or header["qform_code"] != 0
    if not placed and (steps == 0.0).any():
        raise InvalidInput("pixdim", [float(step) for step in steps], "distances other than 0")


def _affine(header: Any) -> Floats:
    """(4, 4) from nodes to positions, unit of the file, x to the right, y to the front, z up."""
    if header["sform_code"] == 0 and header["qform_code"] == 0:
        # Nibabel would flip x, as another format does.
        return np.diag([*np.asarray(header["pixdim"][1:4], dtype=np.float64), 1.0])
    return np.asarray(header.get_best_affine(), dtype=np.float64)

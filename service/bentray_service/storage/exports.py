"""A volume in other file formats, made once and kept."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bentray_workers.atomic import replacing
from bentray_workers.nifti_writing import write_nifti
from bentray_workers.reconstruction_file import read_reconstruction
from bentray_workers.volume_file import read_volume


def values_as_npy(volume: Path, target: Path, *, uploaded: bool) -> Path:
    """A volume's numbers, (x, y[, z]), as a NumPy file; made when first asked for.

    Args:
        volume: its file.
        target: the file to make.
        uploaded: whether it was; else it is a reconstruction, whose speed is taken, m/s.
    """
    if target.exists():
        return target
    values = read_volume(volume).values if uploaded else read_reconstruction(volume).speed
    with replacing(target) as partial, partial.open("wb") as file:
        np.save(file, np.ascontiguousarray(values), allow_pickle=False)
    return target


def values_as_nifti(volume: Path, target: Path, *, uploaded: bool) -> Path:
    """The same with spacing and origin as a NIfTI file.

    Raises:
        InvalidInput: naming ``volume``, for slices at uneven heights.
    """
    if target.exists():
        return target
    if uploaded:
        own = read_volume(volume)
        write_nifti(target, own.values, own.spacing_m, own.origin_m, own.title)
    else:
        result = read_reconstruction(volume)
        write_nifti(target, result.speed, result.spacing_m, result.origin_m, "Speed of sound, m/s")
    return target

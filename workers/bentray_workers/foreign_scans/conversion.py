"""Conversion of scans of all accepted formats to a canonical file, one emission at a time."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

from bentray_kernels.acquisition import Dataset

from ..files.bounded_reading import rejecting_damage
from ..files.dataset.copy import copy_dataset
from ..files.dataset.read import trace_type
from ..files.dataset.write import Piece, bytes_of, write_dataset
from ..files.hdf5_reading import SIGNATURE, Limits, opened
from . import matlab5, npz
from .arrays import Arrays
from .kwave import KWave, is_kwave
from .layouts import layout_of
from .matlab73 import Matlab73

# HDF5 may begin after a user block; that of MATLAB 7.3 has 512 bytes.
USER_BLOCK = 512
MATLAB73 = b"MATLAB 7.3 MAT-file"


def convert_dataset(
    source: Path,
    target: Path,
    limits: Limits | None = None,
    on_size: Callable[[int], None] = lambda size: None,
) -> Dataset:
    """Check a scan and write it as a canonical file, with one emission in memory at a time.

    Accepted are the upload format, MATLAB 5 and 7.3, NumPy archives, and zips of k-Wave outputs, detected by
    content. Other files are rejected as the upload format.

    Args:
        source: of the scan.
        target: replaced atomically.
        limits: of HDF5 files; None: the defaults of ``Limits``.
        on_size: called before writing with the largest size of ``target`` without headers, bytes.

    Returns:
        The dataset, with placeholders for traces.

    Raises:
        InvalidInput: naming the first missing or wrong field, the value found and the accepted values.
        OSError: where the folder cannot be written to or the disk is full.
    """
    with source.open("rb") as file:
        start = file.read(USER_BLOCK + len(SIGNATURE))
    if start.startswith(matlab5.START):
        return _converted(matlab5.Matlab5(source), target, on_size)
    if start.startswith(npz.START):
        with rejecting_damage("file", npz.WHOLE):
            archive = zipfile.ZipFile(source)
        with archive:
            many = is_kwave(archive.namelist())
            return _converted(KWave(archive, target.parent) if many else npz.Npz(archive), target, on_size)
    if start.startswith(MATLAB73) and start[USER_BLOCK:] == SIGNATURE:
        with opened(source, limits or Limits()) as reader:
            return _converted(Matlab73(reader), target, on_size)
    if start.startswith(SIGNATURE):
        with opened(source, limits or Limits()) as reader:
            # Written by h5py or another tool for MATLAB users: without a user block or our format.
            if reader.attribute("", "format") is None and _foreign(reader.names()):
                return _converted(Matlab73(reader), target, on_size)
    return copy_dataset(source, target, limits, on_size)


def _foreign(names: tuple[str, ...]) -> bool:
    return bool({"delta_tof", "element_positions", "full_dataset", "transducerPositionsXY"} & set(names))


def _converted(arrays: Arrays, target: Path, on_size: Callable[[int], None]) -> Dataset:
    layout = layout_of(arrays)
    on_size(bytes_of(layout.dataset))

    def pieces(name: str, chunk: tuple[int, ...]) -> Iterator[Piece]:
        place = layout.traces[name]
        for e, emission in enumerate(arrays.rows(place)):
            where = (slice(e, e + 1), slice(0, emission.shape[0]), slice(0, emission.shape[1]))
            yield where, trace_type(place, emission[None])

    write_dataset(target, layout.dataset, pieces)
    return layout.dataset

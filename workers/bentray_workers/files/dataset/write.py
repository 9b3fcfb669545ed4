"""Atomic writing of a dataset file; the same dataset gives the same bytes."""

import json
import re
from collections.abc import Callable, Iterable
from dataclasses import fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from bentray_kernels.acquisition import Dataset, Truth, Waveform
from bentray_kernels.errors import InvalidInput

from ..hdf5_reading import printable
from ..hdf5_writing import atomic_hdf5
from .read import FORMAT, IMPOSSIBLE, NUMBERS, PAIR_ARRAYS, TEXTS, VERSION

# Below this many bytes chunks take more than compression saves.
PACK_FROM_BYTES = 4096


# Part of an array, and its slices.
Piece = tuple[tuple[slice, ...], NDArray[Any]]
# The traces of a name in pieces; the second argument is the shape of the chunks in the file.
Pieces = Callable[[str, tuple[int, ...]], Iterable[Piece]]


def write_dataset(path: Path, dataset: Dataset, pieces: Pieces | None = None) -> None:
    """Write a dataset in the upload format; ``path`` is replaced atomically.

    Args:
        path: of the file.
        dataset: what to write.
        pieces: returns the values of traces; ``dataset.waveform`` then defines shape and type only.

    Raises:
        InvalidInput: for a dataset without travel times and traces.
        OSError: where the folder cannot be written to or the disk is full.
    """
    if not dataset.picked and dataset.waveform is None:
        raise InvalidInput("traveltime", "neither travel times nor traces", "at least one of the two")
    with atomic_hdf5(Path(path), FORMAT, VERSION) as file:
        _write(file, dataset, pieces)


def bytes_of(dataset: Dataset) -> int:
    """Size of all arrays of a dataset, uncompressed, without headers of its file."""
    records = [record for record in (dataset, dataset.waveform, dataset.truth) if record is not None]
    arrays = (getattr(record, field.name) for record in records for field in fields(record))
    return sum(array.nbytes for array in arrays if isinstance(array, np.ndarray))


def write_array(group: h5py.Group, name: str, array: Any) -> None:
    """Write an array, compressed with gzip unless it is small."""
    array = np.asarray(array)
    group.create_dataset(name, data=array, track_times=False, **_packing(array, True))


def _packing(array: NDArray[Any], chunks: tuple[int, ...] | bool) -> dict[str, Any]:
    if array.size * array.dtype.itemsize < PACK_FROM_BYTES:
        return {}
    # Level 1: for traces, higher levels take several times as long to save a few per cent.
    return {"chunks": chunks, "compression": "gzip", "compression_opts": 1, "shuffle": True}


def _write(file: h5py.File, dataset: Dataset, pieces: Pieces | None) -> None:
    file.attrs["dimension"] = dataset.element_position_m.shape[1]
    for name in TEXTS:
        file.attrs[name] = printable(getattr(dataset, name))
    # By place, in the order of the file.
    values: dict[str, Any] = {
        "geometry@array_type": dataset.array_type,
        "geometry/element_position_m": dataset.element_position_m,
        "geometry/element_normal": dataset.element_normal,
        "acquisition@t0_s": dataset.t0_s,
        "acquisition/tx": dataset.tx,
        "acquisition/rx": dataset.rx,
        "acquisition/wavelet": dataset.wavelet,
        "water@sound_speed_mps": dataset.water_speed_mps,
        "water@temperature_c": dataset.water_temperature_c,
        "water@temperature_assumed": 1 if dataset.water_temperature_assumed else None,
        **{path: getattr(dataset, name) for path, name in PAIR_ARRAYS.items()},
        "traveltime@picker": printable(dataset.picker) if dataset.picker else None,
        f"traveltime@{IMPOSSIBLE}": (
            json.dumps(dict(dataset.impossible_times)) if dataset.impossible_times else None
        ),
        "mask/valid": dataset.valid,
        "mask/roi": dataset.roi,
        "slice/z_m": dataset.slice_z_m,
    }
    for place, value in values.items():
        group, mark, name = re.split("([@/])", place)
        if value is not None and mark == "@":
            file.require_group(group).attrs[name] = value
        elif value is not None:
            write_array(file.require_group(group), name, value)
    if dataset.waveform is not None:
        _write_waveform(file.create_group("waveform"), dataset.waveform, pieces)
    if dataset.truth is not None:
        _write_truth(file.create_group("truth"), dataset.truth)
    for group, attribute, _, name in NUMBERS:
        if getattr(dataset, name) is not None:
            file.require_group(group).attrs[attribute] = getattr(dataset, name)


def _write_waveform(group: h5py.Group, waveform: Waveform, pieces: Pieces | None) -> None:
    group.attrs["scale"] = waveform.scale
    # One emission per chunk, as the picker reads them.
    chunks = tuple(
        np.minimum(waveform.object.shape, (1,) * (waveform.object.ndim - 2) + (256, 4096)).tolist()
    )
    for name, array in (("object", waveform.object), ("water", waveform.water)):
        if array is not None:
            how = _packing(array, chunks)
            made = group.create_dataset(name, array.shape, array.dtype, track_times=False, **how)
            whole = ((slice(None),) * array.ndim, array)
            for where, values in pieces(name, chunks) if pieces is not None else (whole,):
                made[where] = values
    for name, scale in (("object_scale", waveform.object_scale), ("water_scale", waveform.water_scale)):
        if scale is not None:
            write_array(group, name, scale)


def _write_truth(group: h5py.Group, truth: Truth) -> None:
    group.attrs["axes"] = printable(truth.axes)
    group.attrs["spacing_m"] = truth.spacing_m
    group.attrs["origin_m"] = truth.origin_m
    write_array(group, "sound_speed_mps", truth.sound_speed_mps)
    if truth.attenuation_np_m is not None:
        write_array(group, "attenuation_np_m", truth.attenuation_np_m)

"""Layouts of foreign files: from arrays by name to a dataset."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.acquisition import Dataset, Waveform
from bentray_kernels.acquisition.plausibility import check_plausible
from bentray_kernels.errors import InvalidInput
from bentray_kernels.limits import check_size

from ..files.dataset.format import NUMBERS, PAIR_ARRAYS
from .arrays import Arrays, read_small
from .fields import declared, indices, name_in_file, number, placeholder, required, truth, water
from .zip_checks import plain_name

# Tolerance of the time axis, relative to its step.
UNEVEN = 0.01


@dataclass(frozen=True)
class Layout:
    """A dataset with placeholders for traces, and the names of the arrays with the traces."""

    dataset: Dataset
    traces: Mapping[str, str]


def layout_of(arrays: Arrays) -> Layout:
    """The dataset in the arrays.

    Raises:
        InvalidInput: naming the first missing or wrong array, and for an unknown layout.
    """
    names = set(arrays.names())
    for marks, layout in LAYOUTS:
        if marks & names:
            return layout(arrays)
    shown = ", ".join(sorted(filter(plain_name, names))[:8]) or "none"
    raise InvalidInput(
        "file",
        f"{arrays.kind} with the arrays {shown}"[:160],
        "delta_tof and element_positions; time, transducerPositionsXY and full_dataset; or the names of the "
        "upload format",
    )


def _delta_tof(arrays: Arrays) -> Layout:
    """``delta_tof`` (N×N, NaN) and ``element_positions`` (N×2), as of open-UST."""
    position = required(arrays, "element_positions", "(N, 2) numbers in m")
    if position.ndim != 2 or position.shape[1] != 2:
        raise InvalidInput("element_positions", f"shape {position.shape}", "(N, 2) numbers in m")
    delta = required(arrays, "delta_tof", "(N, N) numbers in s")
    count = len(position)
    if delta.shape != (count, count):
        raise InvalidInput(
            "delta_tof", f"shape {delta.shape}", f"({count}, {count}), N by N of element_positions"
        )
    every = np.arange(count)
    return Layout(_dataset(arrays, position, every, every, {"delta_tof_s": delta}), {})


def _full_dataset(arrays: Arrays) -> Layout:
    """``time``, ``transducerPositionsXY`` (2×N) and ``full_dataset`` (Nt×Nrx×Ntx), all elements emit."""
    count = max(declared(arrays, "transducerPositionsXY")[0], default=0)
    check_size("geometry/element_position_m", (count, 2), "transducerPositionsXY")
    position = required(arrays, "transducerPositionsXY", "(2, N) numbers in m")
    if position.ndim != 2 or position.shape[0] != 2:
        raise InvalidInput("transducerPositionsXY", f"shape {position.shape}", "(2, N) numbers in m")
    position, count = position.T, position.shape[1]
    time = required(arrays, "time", "(Nt,) times of the samples in s").ravel()
    steps = np.diff(time)
    if (
        time.size < 2
        or not np.isfinite(time).all()
        or not steps[0] > 0.0
        or np.abs(steps - steps.mean()).max() > UNEVEN * steps.mean()
    ):
        raise InvalidInput("time", f"{time.size} samples, not in even steps", "evenly rising times in s")
    found = arrays.declared("full_dataset")
    accepted = f"({time.size}, {count}, {count}): Nt by Nrx by Ntx, of time and transducerPositionsXY"
    if found is None:
        raise InvalidInput("full_dataset", "nothing", accepted)
    traces = {"object": "full_dataset"}
    if arrays.declared("full_dataset_water") is not None:
        traces["water"] = "full_dataset_water"
    for name in traces.values():
        shape = declared(arrays, name)[0]
        if shape != (count, count, time.size):
            raise InvalidInput(name, f"shape {shape[::-1]}", accepted)
    every = np.arange(count)
    rate = {"sampling_rate_hz": 1.0 / float(steps.mean()), "t0_s": float(time[0])}
    return Layout(_dataset(arrays, position, every, every, rate, traces), traces)


def _named(arrays: Arrays) -> Layout:
    """The names of the upload format, with their groups (``acquisition/tx``) or without (``tx``)."""
    position = required(
        arrays, name_in_file(arrays, "geometry/element_position_m"), "(elements, 2 or 3) numbers in m"
    )
    tx, rx = (indices(arrays, name_in_file(arrays, f"acquisition/{name}")) for name in ("tx", "rx"))
    fields: dict[str, Any] = {}
    for place, name in (*PAIR_ARRAYS.items(), *FURTHER.items()):
        fields[name] = _floats(arrays, place)
    for place, name in FLAGS.items():
        array = read_small(arrays, name_in_file(arrays, place), "booleans")
        fields[name] = None if array is None else np.asarray(array != 0)
    traces = {
        name: name_in_file(arrays, f"waveform/{name}")
        for name in ("object", "water")
        if arrays.declared(name_in_file(arrays, f"waveform/{name}")) is not None
    }
    if "object" not in traces and fields["tof_s"] is None and fields["delta_tof_s"] is None:
        raise InvalidInput("traveltime", "neither travel times nor traces", "delta_tof_s, tof_s or object")
    fields["t0_s"] = number(arrays, "acquisition/t0_s") or 0.0
    return Layout(_dataset(arrays, position, tx, rx, fields, traces), traces)


def _floats(arrays: Arrays, place: str) -> NDArray[np.float64] | None:
    array = read_small(arrays, name_in_file(arrays, place), "numbers")
    return None if array is None else np.asarray(array, dtype=np.float64)


FURTHER = {
    "geometry/element_normal": "element_normal",
    "acquisition/wavelet": "wavelet",
    "slice/z_m": "slice_z_m",
}
FLAGS = {"mask/valid": "valid", "mask/roi": "roi"}

# Arrays that identify a layout, in this order.
LAYOUTS: tuple[tuple[set[str], Callable[[Arrays], Layout]], ...] = (
    ({"delta_tof", "element_positions"}, _delta_tof),
    ({"transducerPositionsXY", "full_dataset"}, _full_dataset),
    ({"element_position_m", "geometry/element_position_m"}, _named),
)


def _dataset(
    arrays: Arrays,
    position: NDArray[Any],
    tx: NDArray[np.int64],
    rx: NDArray[np.int64],
    fields: dict[str, Any],
    traces: Mapping[str, str] | None = None,
) -> Dataset:
    """The dataset with water, frequency and truth of the file."""
    position = np.ascontiguousarray(position, dtype=np.float64)
    speed, temperature, assumed = water(arrays)
    numbers = {name: number(arrays, f"{place}/{leaf}") for place, leaf, _, name in NUMBERS}
    waveform = None
    if traces:
        empty = {name: placeholder(arrays, place) for name, place in traces.items()}
        scale = number(arrays, "waveform/scale")
        waveform = Waveform(
            empty["object"],
            empty.get("water"),
            1.0 if scale is None else scale,
            *(_floats(arrays, f"waveform/{name}") for name in ("object_scale", "water_scale")),
        )
    known = numbers | fields
    dataset = Dataset(
        element_position_m=position,
        tx=tx,
        rx=rx,
        water_speed_mps=speed,
        water_temperature_c=temperature,
        waveform=waveform,
        truth=truth(arrays),
        source=f"from {arrays.kind}{assumed}",
        **{name: value for name, value in known.items() if value is not None},
    )
    check_plausible(dataset)
    return dataset

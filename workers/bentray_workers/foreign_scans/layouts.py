"""Layouts of plain arrays by name: from MATLAB, HDF5 or NumPy files to a dataset."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.acquisition import Dataset, Truth, Waveform, speed_from_temperature
from bentray_kernels.acquisition.plausibility import check_plausible
from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.limits import check_size

from ..files.dataset.read import NUMBERS, PAIR_ARRAYS, trace_type
from .arrays import Arrays, read_small
from .open_scan import Layout, ScanReader, Variable

# Tolerance of the time axis, relative to its step.
UNEVEN = 0.01
# Assumed temperature of water if the file has none; noted in the dataset.
USUAL_C = 20.0
# Further arrays of the upload format, and those of booleans: path in the file, field of Dataset.
FURTHER = {
    "geometry/element_normal": "element_normal",
    "acquisition/wavelet": "wavelet",
    "slice/z_m": "slice_z_m",
}
FLAGS = {"mask/valid": "valid", "mask/roi": "roi"}


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
    samples, rate = _clock(arrays)
    whole = arrays.declared("full_dataset")
    accepted = f"({samples}, {count}, {count}): Nt by Nrx by Ntx, of time and transducerPositionsXY"
    if whole is None:
        raise InvalidInput("full_dataset", "nothing", accepted)
    traces = {"object": "full_dataset"}
    if arrays.declared("full_dataset_water") is not None:
        traces["water"] = "full_dataset_water"
    for name in traces.values():
        shape = declared(arrays, name)[0]
        if shape != (count, count, samples):
            raise InvalidInput(name, f"shape {shape[::-1]}", accepted)
    every = np.arange(count)
    return Layout(_dataset(arrays, position, every, every, rate, traces), traces)


def _clock(arrays: Arrays) -> tuple[int, dict[str, float]]:
    """The number of samples in ``time``, and the sampling rate and time of the first sample."""
    check_size("acquisition/wavelet", declared(arrays, "time")[0], "time")
    time = required(arrays, "time", "(Nt,) times of the samples in s").ravel()
    steps = np.diff(time)
    if (
        time.size < 2
        or not np.isfinite(time).all()
        or not steps[0] > 0.0
        or np.abs(steps - steps.mean()).max() > UNEVEN * steps.mean()
    ):
        raise InvalidInput("time", f"{time.size} samples, not in even steps", "evenly rising times in s")
    return time.size, {"sampling_rate_hz": 1.0 / float(steps.mean()), "t0_s": float(time[0])}


def named_layout(arrays: Arrays) -> Layout:
    """The names of the upload format, with their groups (``acquisition/tx``) or without (``tx``)."""
    position = required(
        arrays, name_in_file(arrays, "geometry/element_position_m"), "(elements, 2 or 3) numbers in m"
    )
    tx, rx = (indices(arrays, name_in_file(arrays, f"acquisition/{name}")) for name in ("tx", "rx"))
    fields: dict[str, Any] = {}
    for path, name in (*PAIR_ARRAYS.items(), *FURTHER.items()):
        fields[name] = _floats(arrays, path)
    for path, name in FLAGS.items():
        array = read_small(arrays, name_in_file(arrays, path), "booleans")
        fields[name] = None if array is None else np.asarray(array != 0)
    traces = {
        name: name_in_file(arrays, f"waveform/{name}")
        for name in ("object", "water")
        if arrays.declared(name_in_file(arrays, f"waveform/{name}")) is not None
    }
    if "object" not in traces and fields["tof_s"] is None and fields["delta_tof_s"] is None:
        raise InvalidInput("traveltime", "neither travel times nor traces", "delta_tof_s, tof_s or object")
    fields["t0_s"] = number(arrays, "acquisition/t0_s") or 0.0
    if (
        "object" in traces
        and number(arrays, "acquisition/sampling_rate_hz") is None
        and "time" in arrays.names()
    ):
        fields |= _clock(arrays)[1]
    return Layout(_dataset(arrays, position, tx, rx, fields, traces), traces)


def _floats(arrays: Arrays, path: str) -> NDArray[np.float64] | None:
    array = read_small(arrays, name_in_file(arrays, path), "numbers")
    return None if array is None else np.asarray(array, dtype=np.float64)


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
    note = f"; water temperature not given, {temperature:g} °C assumed" if assumed else ""
    numbers = {name: number(arrays, f"{path}/{leaf}") for path, leaf, _, name in NUMBERS}
    waveform = None
    if traces:
        empty = {name: placeholder(arrays, path) for name, path in traces.items()}
        scale = number(arrays, "waveform/scale")
        waveform = Waveform(
            empty["object"],
            empty.get("water"),
            1.0 if scale is None else scale,
            *(_floats(arrays, f"waveform/{name}") for name in ("object_scale", "water_scale")),
        )
    stated = numbers | fields
    dataset = Dataset(
        element_position_m=position,
        tx=tx,
        rx=rx,
        water_speed_mps=speed,
        water_temperature_c=temperature,
        water_temperature_assumed=assumed,
        waveform=waveform,
        truth=truth(arrays),
        source=f"from {arrays.kind}{note}",
        **{name: value for name, value in stated.items() if value is not None},
    )
    check_plausible(dataset)
    return dataset


def water(arrays: Arrays) -> tuple[float, float | None, bool]:
    """Speed and temperature of water, and whether they are assumed."""
    speed, temperature = (number(arrays, f"water/{name}") for name in ("sound_speed_mps", "temperature_c"))
    if speed is not None:
        return speed, temperature, False
    if temperature is not None:
        return speed_from_temperature(temperature), temperature, False
    return speed_from_temperature(USUAL_C), USUAL_C, True


def truth(arrays: Arrays) -> Truth | None:
    """The truth; only with its group, since its speed has the same name as that of water."""
    speed = read_small(arrays, "truth/sound_speed_mps", "numbers in m/s")
    if speed is None:
        return None
    spacing, origin = (
        required(arrays, f"truth/{name}", "a number in m for each axis").ravel()
        for name in ("spacing_m", "origin_m")
    )
    losses = read_small(arrays, "truth/attenuation_np_m", "numbers in Np/m")
    return Truth(
        np.asarray(speed, dtype=np.float64),
        tuple(float(v) for v in (np.repeat(spacing, speed.ndim) if spacing.size == 1 else spacing)),
        tuple(float(v) for v in origin),
        None if losses is None else np.asarray(losses, dtype=np.float64),
        "x,y" if speed.ndim == 2 else "x,y,z",
    )


def name_in_file(arrays: Arrays, path: str) -> str:
    """The name of an array of the upload format in this file: with or without its group."""
    leaf = path.rpartition("/")[2]
    return path if path in arrays.names() or leaf not in arrays.names() else leaf


def required(arrays: Arrays, name: str, accepted: str) -> NDArray[np.float64]:
    """A small array of numbers that must be present."""
    array = read_small(arrays, name, accepted)
    if array is None:
        raise InvalidInput(name, "nothing", accepted)
    return np.asarray(array, dtype=np.float64)


def declared(arrays: Arrays, name: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type of an array that must be present."""
    declaration = arrays.declared(name)
    if declaration is None:
        raise InvalidInput(name, "nothing", "an array")
    return declaration


def indices(arrays: Arrays, name: str) -> NDArray[np.int64]:
    """Indices of elements."""
    accepted = "(n,) integers that count elements from 0"
    array = read_small(arrays, name, accepted)
    if array is None or array.dtype.kind not in "iu":
        raise InvalidInput(name, "nothing" if array is None else f"{array.dtype}", accepted)
    if array.dtype.kind == "u" and array.size and array.max() > np.iinfo(np.int64).max:
        raise InvalidInput(name, array.max(), accepted)
    return np.ascontiguousarray(array, dtype=np.int64)


def number(arrays: Arrays, path: str) -> float | None:
    """A finite number, or None."""
    name = name_in_file(arrays, path)
    declaration = arrays.declared(name)
    # Checked before reading, since it may be large.
    if declaration is not None and math.prod(declaration[0]) != 1:
        raise InvalidInput(name, f"shape {declaration[0]}", "one finite number")
    array = read_small(arrays, name, "one number")
    if array is None:
        return None
    if not np.isfinite(array).all():
        raise InvalidInput(name, array.ravel()[0], "one finite number")
    return float(array.ravel()[0])


def placeholder(arrays: Arrays, name: str) -> NDArray[Any]:
    """An array of the shape and type of the traces that takes no memory."""
    shape, dtype = declared(arrays, name)
    if len(shape) != 3:
        raise InvalidInput(name, f"shape {shape}", "(ntx, nrx, nt)")
    return np.broadcast_to(np.zeros((), trace_type(dtype)), shape)


def _has(*names: str) -> Any:
    return lambda scan: bool(scan.names & set(names))


_WATER = (
    Variable(
        "sound_speed_mps or temperature_c", "number", "m/s, °C", "of the water; absent: 20 °C assumed", "no"
    ),
    Variable("center_frequency_hz", "number", "Hz", "centre frequency", "no"),
)

DELTA_TOF = ScanReader(
    title="Travel times of open-UST (MATLAB, NumPy)",
    about="MATLAB 5 or 7.3, or `.npz`; all elements emit and receive.",
    variables=(
        Variable("element_positions", "(N, 2)", "m", "positions of the elements"),
        Variable("delta_tof", "(N, N)", "s", "arrival with the object minus arrival in water"),
        *_WATER,
    ),
    detect=_has("delta_tof", "element_positions"),
    layout=_delta_tof,
)
FULL_DATASET = ScanReader(
    title="Traces of a ring (MATLAB)",
    about="MATLAB 5 or 7.3, as of WaveformInversionUST and of r-Wave; all elements emit and receive. The "
    "first sample is at `time(1)`.",
    variables=(
        Variable("time", "(Nt,)", "s", "times of the samples, equally spaced"),
        Variable("transducerPositionsXY", "(2, N)", "m", "positions of the elements"),
        Variable("full_dataset", "(Nt, Nrx, Ntx)", "any", "traces; Nrx and Ntx are N"),
        Variable("full_dataset_water", "(Nt, Nrx, Ntx)", "any", "the same without the object", "no"),
        *_WATER,
    ),
    detect=_has("transducerPositionsXY", "full_dataset"),
    layout=_full_dataset,
)
NAMED = ScanReader(
    title="The names of the upload format (NumPy, MATLAB)",
    about="`.npz` of plain arrays, or MATLAB 5 or 7.3, under the names of the table above without their "
    "groups (`tx`), in `.npz` also with them (`acquisition/tx`); attributes are arrays of one number. MATLAB "
    "stores axes reversed, so that traces are (nt, nrx, ntx) there.",
    variables=(
        Variable("element_position_m", "(elements, 2 or 3)", "m", "positions of the elements"),
        Variable("tx, rx", "(ntx,), (nrx,) integers", "", "emitting and receiving elements, counted from 0"),
        Variable(
            "delta_tof_s, tof_s or object", "(ntx, nrx) or (ntx, nrx, nt)", "s, any", "travel times or traces"
        ),
        Variable("sampling_rate_hz or time", "number or (nt,)", "Hz, s", "of the traces", "with traces"),
        *_WATER,
    ),
    detect=_has("element_position_m", "geometry/element_position_m"),
)

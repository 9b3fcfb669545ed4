"""Reading a dataset file in the upload format; errors name the field, its value and accepted values."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.acquisition import (
    Dataset,
    Truth,
    Waveform,
    speed_from_temperature,
    temperature_from_speed,
)
from bentray_kernels.acquisition.plausibility import ImplausibleUnit, WrongArrangement, check_plausible
from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.limits import COUNTED, OVER_NODES, OVER_PAIRS, check_size

from ..hdf5_reading import Reader, opened
from .units import POSITION_UNITS, TIME_UNITS

FORMAT = "uct-transmission"
VERSION = "1.0"

# Arrays over (ntx, nrx), with a leading nz axis for slices: path in the file, field of Dataset.
PAIR_ARRAYS = {
    "traveltime/tof_s": "tof_s",
    "traveltime/delta_tof_s": "delta_tof_s",
    "traveltime/sigma_s": "sigma_s",
    "amplitude/log_ratio_np": "log_ratio_np",
}

# Number attributes: (group, name, unit, field of Dataset).
NUMBERS = (
    ("geometry", "radius_m", "m", "radius_m"),
    ("acquisition", "center_frequency_hz", "Hz", "center_frequency_hz"),
    ("acquisition", "sampling_rate_hz", "Hz", "sampling_rate_hz"),
    ("water", "attenuation_np_m", "Np/m", "water_attenuation_np_m"),
    ("amplitude", "frequency_hz", "Hz", "amplitude_frequency_hz"),
)

# Text attribute of the travel times: numbers of impossible ones that became NaN, by kind, as JSON.
IMPOSSIBLE = "impossible_times"

# Text attributes of the root, by the same names in Dataset.
TEXTS = ("title", "source", "license")

NUMERIC = "iuf"
# Arrays whose number of rows, pairs or nodes is checked before anything is read.
SIZED = (*(path for path in COUNTED if path not in OVER_PAIRS), *OVER_PAIRS, *OVER_NODES)
TRACES = "real numbers, traces over (ntx, nrx, nt)"


def read_dataset(path: Path, *, traces: bool = True, plausible: bool = True) -> Dataset:
    """Read and check a dataset file.

    Args:
        path: of the HDF5 file.
        traces: false: leave the traces, which may be large, in the file; they are checked but not read.
        plausible: false: units and order of the elements may be wrong, to be corrected.

    Raises:
        InvalidInput: naming the first missing or wrong field by its path in the file (``file`` for the file
            as a whole), the value found and the accepted values; and as ``check_plausible``.
    """
    with opened(Path(path)) as reader:
        return dataset_of(reader, waveform_in if traces else None, plausible=plausible)


def dataset_of(
    reader: Reader, waveform: Callable[[Reader], Waveform | None] | None, *, plausible: bool = True
) -> Dataset:
    """The dataset in an open file, see ``read_dataset``.

    Args:
        reader: of the file.
        waveform: reads the traces, if any.
        plausible: false: times and lengths may be in other units, to be corrected.
    """
    _check_format(reader)
    for path in SIZED:
        check_size(path, _shape(reader, path))
    speed, temperature = _water(reader)
    accepted = "(elements, 2 or 3) numbers in m"
    position = np.ascontiguousarray(
        reader.required("geometry/element_position_m", NUMERIC, accepted), np.float64
    )
    dimension = reader.number("", "dimension", "2 or 3")
    if dimension is not None and position.ndim == 2 and dimension != position.shape[1]:
        raise InvalidInput("@dimension", f"{dimension:g}", f"{position.shape[1]}, as element_position_m has")
    tx, rx = _indices(reader, "acquisition/tx"), _indices(reader, "acquisition/rx")
    slices = _floats(reader, "slice/z_m", "(nz,) numbers in m")
    pairs = (*(() if slices is None else slices.shape[:1]), *tx.shape[:1], *rx.shape[:1])
    # Arrays that are not lists are rejected below.
    for path in (*PAIR_ARRAYS, "mask/valid") if tx.ndim == rx.ndim == 1 else ():
        # Checked before reading: they are by far the largest.
        shape = _shape(reader, path)
        if 0 < math.prod(pairs) < math.prod(shape):
            raise InvalidInput(path, f"shape {shape}", f"shape {pairs}")
    fields: dict[str, Any] = {
        name: _floats(reader, path, "numbers over (ntx, nrx)") for path, name in PAIR_ARRAYS.items()
    }
    fields |= {name: reader.number(group, attribute, unit) for group, attribute, unit, name in NUMBERS}
    fields |= {name: reader.text("", name) or "" for name in TEXTS}
    if not traces_in(reader) and fields["tof_s"] is None and fields["delta_tof_s"] is None:
        raise InvalidInput(
            "traveltime",
            "neither travel times nor traces",
            "traveltime/delta_tof_s, traveltime/tof_s or waveform/object",
        )
    dataset = Dataset(
        element_position_m=np.ascontiguousarray(position, np.float64),
        tx=tx,
        rx=rx,
        water_speed_mps=speed,
        water_temperature_c=temperature,
        water_temperature_assumed=bool(reader.number("water", "temperature_assumed", "0 or 1") or 0.0),
        element_normal=_floats(reader, "geometry/element_normal", "numbers, one row an element"),
        array_type=reader.text("geometry", "array_type") or "ring",
        t0_s=reader.number("acquisition", "t0_s", "s") or 0.0,
        wavelet=_floats(reader, "acquisition/wavelet", "(nt,) numbers"),
        valid=_flags(reader, "mask/valid", "booleans over (ntx, nrx)"),
        roi=_flags(reader, "mask/roi", "an image of booleans"),
        slice_z_m=slices,
        picker=reader.text("traveltime", "picker") or "",
        waveform=waveform(reader) if waveform is not None and traces_in(reader) else None,
        truth=_truth(reader),
        impossible_times=_impossible_times(reader),
        **fields,
    )
    if plausible:
        check_readable(dataset)
    return dataset


def _impossible_times(reader: Reader) -> dict[str, int]:
    """Numbers of impossible times that an earlier reading of the scan left out, by their kind."""
    stated = reader.text("traveltime", IMPOSSIBLE) or "{}"
    try:
        counts = json.loads(stated)
        return {str(kind): int(count) for kind, count in counts.items()}
    except (ValueError, AttributeError, TypeError):
        accepted = "numbers of left out times by kind, as JSON"
        raise InvalidInput(f"traveltime@{IMPOSSIBLE}", repr(stated)[:60], accepted) from None


def check_readable(dataset: Dataset) -> None:
    """Like ``check_plausible``; for a likely unit or order the error also states the correcting command."""
    try:
        check_plausible(dataset)
    except WrongArrangement as error:
        if error.proposal is None:
            raise
        hint = f"; correct a copy: bentray correct SCAN -o COPY --arrangement {error.proposal.name}"
        raise InvalidInput(error.field, error.value, error.accepted + hint) from None
    except ImplausibleUnit as error:
        unit = error.unit.replace("µ", "u")
        if unit not in (*TIME_UNITS, *POSITION_UNITS):
            raise
        option = f"--{'times' if unit in TIME_UNITS else 'positions'}-in {unit}"
        hint = f", or correct a copy: bentray correct SCAN -o COPY {option}"
        likely = error.accepted.removeprefix(error.plain)
        raise ImplausibleUnit(error.field, error.value, error.plain, likely + hint, error.unit) from None


def _shape(reader: Reader, path: str) -> tuple[int, ...]:
    """Shape of an array as the file declares it; () where it is absent, or one number."""
    stored = reader.checked(path, "iufb", "an array of numbers")
    return () if stored is None else tuple(stored.shape)


def _check_format(reader: Reader) -> None:
    for name, expected in (("format", FORMAT), ("format_version", VERSION)):
        value = reader.attribute("", name)
        if not isinstance(value, str) or value != expected:
            shown = "nothing" if value is None else repr(value if isinstance(value, str) else value.tolist())
            raise InvalidInput(f"@{name}", shown[:60], f'"{expected}"')


def _water(reader: Reader) -> tuple[float, float | None]:
    """Speed and temperature of the water; where one is absent it follows from the other."""
    speed = reader.number("water", "sound_speed_mps", "m/s")
    temperature = reader.number("water", "temperature_c", "°C")
    if speed is None and temperature is None:
        raise InvalidInput(
            "water@sound_speed_mps", "nothing", "@sound_speed_mps in m/s or @temperature_c in °C"
        )
    if speed is None:
        assert temperature is not None
        return speed_from_temperature(temperature), temperature
    if temperature is None:
        try:
            temperature = temperature_from_speed(speed)
        except InvalidInput:
            # Another coupling medium than pure water; only its speed is needed.
            return speed, None
    return speed, temperature


def traces_in(reader: Reader) -> bool:
    """Whether there are traces; they are checked."""
    return reader.checked("waveform/object", "iuf", "traces over (ntx, nrx, nt)") is not None


def placeholder_traces(reader: Reader) -> Waveform | None:
    """Arrays of zeros of the shape and type of the traces, which take no memory."""

    def placeholder(path: str) -> NDArray[Any] | None:
        stored = reader.checked(path, NUMERIC, TRACES)
        if stored is None:
            return None
        return np.broadcast_to(np.zeros((), trace_type(stored.dtype)), stored.shape)

    return waveform_in(reader, placeholder)


def trace_type(dtype: np.dtype[Any]) -> np.dtype[Any]:
    """Type in which traces are kept: int16 where that holds theirs, else float32.

    Values of 24 bits stay exact; longer ones, of wide integers and float64, are rounded to -144 dB of each.
    """
    return np.dtype(np.int16 if np.can_cast(dtype, np.int16) else np.float32)


def kept_traces(array: NDArray[Any]) -> NDArray[Any]:
    """Traces as ``trace_type``, contiguous."""
    # A damaged NaN may signal, which is no reason to warn.
    with np.errstate(over="ignore", invalid="ignore"):
        return np.ascontiguousarray(array, dtype=trace_type(array.dtype)).reshape(array.shape)


def waveform_in(
    reader: Reader, traces: Callable[[str], Any] | None = None, index: int | None = None
) -> Waveform | None:
    """The traces with their scales; None where there are none.

    Args:
        reader: of the file.
        traces: reads those of a path in its own way.
        index: of the slice whose scales are read; None: of all.
    """
    scale = reader.number("waveform", "scale", "the unit of the traces a count")
    read = traces or (lambda path: _traces(reader, path))
    received = read("waveform/object")
    if received is None:
        return None
    scales = []
    for name in ("object_scale", "water_scale"):
        factors = _floats(reader, f"waveform/{name}", "numbers over (ntx, nrx)")
        scales.append(factors if factors is None or index is None else factors[index])
    return Waveform(received, read("waveform/water"), 1.0 if scale is None else scale, *scales)


def _traces(reader: Reader, path: str) -> NDArray[Any] | None:
    array = reader.array(path, NUMERIC, TRACES)
    return None if array is None else kept_traces(array)


def _truth(reader: Reader) -> Truth | None:
    speed = _floats(reader, "truth/sound_speed_mps", "(nx, ny) or (nx, ny, nz) numbers in m/s")
    if speed is None:
        return None
    spacing = reader.numbers("truth", "spacing_m", "m")
    origin = reader.numbers("truth", "origin_m", "m")
    for name, value in (("spacing_m", spacing), ("origin_m", origin)):
        if value is None:
            raise InvalidInput(f"truth@{name}", "nothing", "a number in m for each axis")
    assert spacing is not None
    assert origin is not None
    return Truth(
        speed,
        spacing * speed.ndim if len(spacing) == 1 else spacing,
        origin,
        _floats(reader, "truth/attenuation_np_m", "numbers in Np/m, as many as in sound_speed_mps"),
        reader.text("truth", "axes") or ("x,y" if speed.ndim == 2 else "x,y,z"),
    )


def _floats(reader: Reader, path: str, accepted: str) -> NDArray[np.float64] | None:
    array = reader.array(path, NUMERIC, accepted)
    return None if array is None else np.ascontiguousarray(array, dtype=np.float64)


def _flags(reader: Reader, path: str, accepted: str) -> NDArray[np.bool_] | None:
    # MATLAB writes logical arrays as uint8.
    array = reader.array(path, "biu", accepted)
    return None if array is None else np.ascontiguousarray(array != 0)


def _indices(reader: Reader, path: str) -> NDArray[np.int64]:
    accepted = "(n,) integers that count elements from 0"
    array = reader.required(path, "iu", accepted)
    if array.dtype.kind == "u" and array.size and array.max() > np.iinfo(np.int64).max:
        raise InvalidInput(path, array.max(), accepted)
    return np.ascontiguousarray(array, dtype=np.int64)

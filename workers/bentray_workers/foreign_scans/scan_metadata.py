"""Properties of a scan that its user states: own names of variables, units, water and frequency."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.acquisition import speed_from_temperature
from bentray_kernels.acquisition.plausibility import LENGTHS, TIMES
from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.limits import ELEMENTS, FREQUENCY_HZ, SPEED_MPS, TEMPERATURE_C

from .arrays import Arrays

# Fields that a variable can be named for: their place in the upload format, and the kind of their unit.
FIELDS: Mapping[str, tuple[str, str]] = {
    "element_position": ("geometry/element_position_m", "length"),
    "element_normal": ("geometry/element_normal", ""),
    "tx": ("acquisition/tx", "index"),
    "rx": ("acquisition/rx", "index"),
    "delta_tof": ("traveltime/delta_tof_s", "time"),
    "tof": ("traveltime/tof_s", "time"),
    "sigma": ("traveltime/sigma_s", "time"),
    "log_ratio": ("amplitude/log_ratio_np", ""),
    "valid": ("mask/valid", ""),
    "object": ("waveform/object", ""),
    "water": ("waveform/water", ""),
    "time": ("time", "time"),
    "sampling_rate": ("acquisition/sampling_rate_hz", ""),
    "t0": ("acquisition/t0_s", "time"),
    "center_frequency": ("acquisition/center_frequency_hz", ""),
    "sound_speed": ("water/sound_speed_mps", ""),
    "temperature": ("water/temperature_c", ""),
    "slice_z": ("slice/z_m", "length"),
}
# The same by their full names, such as ``element_position_m``.
PLACES = {name: path for name, (path, _) in FIELDS.items()} | {
    path.rpartition("/")[2]: path for path, _ in FIELDS.values()
}
# Kind of the unit by name of the array: of the upload format, and of the layouts of other programs.
KINDS = dict(FIELDS.values()) | {
    "element_positions": "length",
    "transducerPositionsXY": "length",
    **{path.rpartition("/")[2]: kind for path, kind in FIELDS.values()},
}
UNITS: Mapping[str, tuple[str, float]] = {
    "m": ("length", 1.0),
    "s": ("time", 1.0),
    **{unit: ("length", factor) for unit, factor in LENGTHS.items()},
    **{unit: ("time", factor) for unit, factor in TIMES.items()},
    "um": ("length", 1e-6),
    "us": ("time", 1e-6),
}
# Of a MATLAB variable, or the path of an array in HDF5.
VARIABLE = re.compile(r"[\w./ -]{1,200}")
# Speeds of water that contradict each other differ by more.
AGREED_MPS = 15.0
# Options of numbers by their places in the upload format: name and range.
NUMBERS = {
    "water/temperature_c": ("temperature", TEMPERATURE_C),
    "water/sound_speed_mps": ("sound speed", SPEED_MPS),
    "acquisition/center_frequency_hz": ("frequency", FREQUENCY_HZ),
}
POSITION = "geometry/element_position_m"
INDICES = ("acquisition/tx", "acquisition/rx")


@dataclass(frozen=True)
class ScanMetadata:
    """Statements of the user about a scan.

    Attributes:
        variables: name in the file, by place in the upload format.
        factors: unit of lengths and of times in SI units, by kind; absent: m and s.
        numbers: values that replace those of the file, by place in the upload format.
    """

    variables: Mapping[str, str] = field(default_factory=dict)
    factors: Mapping[str, float] = field(default_factory=dict)
    numbers: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def from_options(
        cls,
        map: Iterable[str] = (),  # noqa: A002 - the name of the option
        unit: Iterable[str] = (),
        temperature_c: float | None = None,
        sound_speed_mps: float | None = None,
        frequency_hz: float | None = None,
    ) -> Self:
        """Parse the options of a command or the fields of a request.

        Args:
            map: pairs such as ``element_position=pos``.
            unit: at most one of length and one of time, such as ``mm`` and ``us``.
            temperature_c, sound_speed_mps: of the water.
            frequency_hz: centre frequency of the pulse.

        Raises:
            InvalidInput: naming the option, its value and the accepted values.
        """
        stated = {}
        for path, value in zip(NUMBERS, (temperature_c, sound_speed_mps, frequency_hz), strict=True):
            if value is not None:
                name, within = NUMBERS[path]
                within.check(name, value)
                stated[path] = float(value)
        return cls(_variables(map), _factors(unit), stated)

    def words(self) -> str:
        """The names of what is stated, for errors."""
        named = {"map": self.variables, "unit": self.factors}
        numbers = (NUMBERS[path][0] for path in self.numbers)
        return ", ".join([*(name for name, values in named.items() if values), *numbers])

    def __bool__(self) -> bool:
        return bool(self.variables or self.factors or self.numbers)


def _variables(pairs: Iterable[str]) -> dict[str, str]:
    variables: dict[str, str] = {}
    for pair in pairs:
        name, _, variable = pair.partition("=")
        path = PLACES.get(name.strip())
        if path is None or not VARIABLE.fullmatch(variable.strip()):
            raise InvalidInput("map", repr(pair[:80]), f"FIELD=VARIABLE with a field of {', '.join(FIELDS)}")
        if path in variables:
            raise InvalidInput("map", repr(pair[:80]), f"one variable for {name}, which was named before")
        variables[path] = variable.strip().strip("/")
    return variables


def _factors(units: Iterable[str]) -> dict[str, float]:
    factors: dict[str, float] = {}
    for unit in units:
        # Two characters look like a micro sign.
        kind, factor = UNITS.get(unit.strip().replace("\u03bc", "\u00b5"), ("", 0.0))
        if not kind:
            raise InvalidInput("unit", repr(unit[:20]), f"one of {', '.join(UNITS)}")
        if kind in factors:
            raise InvalidInput("unit", repr(unit[:20]), f"one unit of {kind}; another was given before")
        factors[kind] = factor
    return factors


class ArraysWithMetadata:
    """The arrays of a file with what the user states about them; see ``Arrays``.

    Args:
        arrays: of the file.
        given: by the user.

    Raises:
        InvalidInput: for a variable that is not in the file, and water that contradicts that of the file.
    """

    def __init__(self, arrays: Arrays, given: ScanMetadata) -> None:
        self._arrays = arrays
        self._given = given
        self._present = frozenset(arrays.names())
        self.kind = arrays.kind
        self.reversed_axes = arrays.reversed_axes
        for path, variable in given.variables.items():
            if arrays.declared(variable) is None:
                shown = ", ".join(sorted(self._present)[:12])
                raise InvalidInput(
                    f"map {_field(path)}", f"no variable {variable!r}", f"one of {shown}"[:200]
                )
        self._replaced = self._check_water()
        self._stated: dict[str, NDArray[Any]] = {
            path: np.array(number) for path, number in given.numbers.items()
        }
        if POSITION in given.variables:
            self._stated |= self._all_elements()

    def names(self) -> tuple[str, ...]:
        own = (name for name in self._arrays.names() if name not in self._replaced)
        return (*own, *self._given.variables, *self._stated)

    def declared(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]] | None:
        if name in self._stated:
            return self._stated[name].shape, self._stated[name].dtype
        if name in self._replaced:
            return None
        array = self._arrays.declared(self._variable(name))
        return (array[0][::-1], array[1]) if array is not None and self._turned(name, array[0]) else array

    def whole(self, name: str) -> NDArray[Any]:
        if name in self._stated:
            return self._stated[name]
        array = self._arrays.whole(self._variable(name))
        if self._turned(name, array.shape):
            array = array.T
        if name in INDICES and name in self._given.variables:
            return self._counted_from_0(name, array)
        factor = self._given.factors.get(KINDS.get(name, ""), 1.0)
        return array if factor == 1.0 else factor * np.asarray(array, dtype=np.float64)

    def rows(self, name: str) -> Iterator[NDArray[Any]]:
        return self._arrays.rows(self._variable(name))

    def _variable(self, name: str) -> str:
        return self._given.variables.get(name, name)

    def _turned(self, name: str, shape: Sequence[int]) -> bool:
        """Whether positions that the user names are stored with the coordinates along the other axis."""
        if name != POSITION or name not in self._given.variables or len(shape) != 2:
            return False
        coordinates = 0 if self.reversed_axes else 1
        return shape[coordinates] not in (2, 3) and shape[1 - coordinates] in (2, 3)

    def _all_elements(self) -> dict[str, NDArray[Any]]:
        """Emitters and receivers of a file without a list of them: all elements, in their order."""
        declared = self.declared(POSITION)
        assert declared is not None
        count = declared[0][-1 if self.reversed_axes else 0] if declared[0] else 0
        ELEMENTS.check(f"elements of {self._variable(POSITION)}", count)
        stated = {*self._given.variables, *(path for path in INDICES if {path, path[-2:]} & self._present)}
        return {path: np.arange(count) for path in INDICES if path not in stated}

    def _counted_from_0(self, name: str, array: NDArray[Any]) -> NDArray[Any]:
        """Indices of elements in variables that the user names; MATLAB counts from 1, and in doubles."""
        with np.errstate(invalid="ignore"):
            whole = np.asarray(array, dtype=np.int64).ravel()
        if not np.array_equal(whole, np.ravel(array)):
            raise InvalidInput(self._variable(name), "fractions", "indices of elements")
        return whole - 1 if self.reversed_axes else whole

    def _check_water(self) -> frozenset[str]:
        """Names of water properties in the file that those of the user replace."""
        temperature, speed = (self._given.numbers.get(f"water/{name}") for name in WATER)
        if temperature is None and speed is None:
            return frozenset()
        stated = speed if speed is not None else speed_from_temperature(temperature or 0.0)
        replaced = frozenset(
            stored for name in WATER for stored in (f"water/{name}", name) if stored in self._present
        ) - frozenset(self._given.variables.values())
        for name in replaced:
            declaration = self._arrays.declared(name)
            if declaration is None or np.prod(declaration[0], dtype=np.int64) != 1:
                continue
            own = float(self._arrays.whole(name).ravel()[0])
            in_file = own if name.endswith("sound_speed_mps") else speed_from_temperature(own)
            if not abs(in_file - stated) <= AGREED_MPS:
                raise InvalidInput(
                    "sound speed" if temperature is None else "temperature",
                    f"{stated:.1f} m/s in the water, while {name} of the file is {own:g} ({in_file:.1f} m/s)",
                    f"a value within {AGREED_MPS:g} m/s of that of the file, or none",
                )
        return replaced


WATER = ("temperature_c", "sound_speed_mps")


def _field(path: str) -> str:
    return next(name for name, (other, _) in FIELDS.items() if other == path)

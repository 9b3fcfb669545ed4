"""Arrays of foreign files by name: small ones read whole, large ones by rows."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.limits import COUNTED, OVER_PAIRS, check_size

from ..files.bounded_reading import check_row

# Of an array that is read whole.
LARGEST_WHOLE = 256 * 2**20

# Fields of the upload format by names without groups, and by foreign names.
PLACES = {path.rpartition("/")[2]: path for path in (*COUNTED, *OVER_PAIRS)} | {
    "element_positions": "geometry/element_position_m",
    "delta_tof": "traveltime/delta_tof_s",
}


class Arrays(Protocol):
    """The arrays of one open file in C order; those of MATLAB have reversed axes, as stored.

    Attributes:
        kind: of file, in words.
        reversed_axes: whether axes are reversed relative to the program of the user.
    """

    kind: str
    reversed_axes: bool

    def names(self) -> tuple[str, ...]:
        """Names of the variables, readable or not."""

    def declared(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]] | None:
        """Checked shape and type of an array of numbers; None if it is absent.

        Raises:
            InvalidInput: naming it, for anything but a plain array of numbers.
        """

    def whole(self, name: str) -> NDArray[Any]:
        """Read an array that is present."""

    def rows(self, name: str) -> Iterator[NDArray[Any]]:
        """Its rows along the first axis, one after the other."""


def read_small(arrays: Arrays, name: str, accepted: str) -> NDArray[Any] | None:
    """An array with axes in the order of the user; None if it is absent.

    Raises:
        InvalidInput: naming it, for other content than numbers, or too large an array.
    """
    declaration = arrays.declared(name)
    if declaration is None:
        return None
    shape, dtype = declaration
    check_size(PLACES.get(name, name), shape[::-1] if arrays.reversed_axes else shape, name)
    size = math.prod(shape) * dtype.itemsize
    if size > LARGEST_WHOLE:
        raise InvalidInput(name, f"shape {shape}, {size} bytes", accepted)
    array = arrays.whole(name)
    return array.T if arrays.reversed_axes else array


class Traces(NamedTuple):
    """Traces that are read by emission.

    Attributes:
        shape: (ntx, nrx, nt).
        dtype: of a sample.
        emissions: returns the (nrx, nt) traces of the emissions, one after the other.
    """

    shape: tuple[int, int, int]
    dtype: np.dtype[Any]
    emissions: Callable[[], Iterator[NDArray[Any]]]


@dataclass
class StreamedScan:
    """The arrays of one scan; see ``Arrays``.

    Attributes:
        kind: of file, in words.
        small: arrays by their path in the upload format; numbers have no axes, and None is left out.
        traces: of ``waveform/object`` and ``waveform/water``.
    """

    kind: str
    small: Mapping[str, NDArray[Any] | float | None]
    traces: Mapping[str, Traces] = field(default_factory=dict)
    reversed_axes: bool = False

    def __post_init__(self) -> None:
        self._small = {path: np.asarray(value) for path, value in self.small.items() if value is not None}

    def names(self) -> tuple[str, ...]:
        return (*self._small, *self.traces)

    def declared(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]] | None:
        if name in self.traces:
            return self.traces[name].shape, self.traces[name].dtype
        return None if name not in self._small else (self._small[name].shape, self._small[name].dtype)

    def whole(self, name: str) -> NDArray[Any]:
        return self._small[name]

    def rows(self, name: str) -> Iterator[NDArray[Any]]:
        traces = self.traces[name]
        check_row(name, traces.shape, traces.dtype)
        return traces.emissions()

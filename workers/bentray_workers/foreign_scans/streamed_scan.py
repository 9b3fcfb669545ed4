"""A foreign scan under the names of the upload format: small arrays in memory, traces by emission."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..files.bounded_reading import check_row


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
        small: arrays by their path in the upload format; numbers have no axes.
        traces: of ``waveform/object`` and ``waveform/water``.
    """

    kind: str
    small: Mapping[str, NDArray[Any]]
    traces: Mapping[str, Traces] = field(default_factory=dict)
    reversed_axes: bool = False

    def names(self) -> tuple[str, ...]:
        return (*self.small, *self.traces)

    def declared(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]] | None:
        if name in self.traces:
            return self.traces[name].shape, self.traces[name].dtype
        return None if name not in self.small else (self.small[name].shape, self.small[name].dtype)

    def whole(self, name: str) -> NDArray[Any]:
        return self.small[name]

    def rows(self, name: str) -> Iterator[NDArray[Any]]:
        traces = self.traces[name]
        check_row(name, traces.shape, traces.dtype)
        return traces.emissions()

"""Lazily read traces: one emission at a time, with channels reordered and polarity corrected on reading."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..arrays import Flags, Ints


@dataclass(frozen=True)
class Emissions:
    """The traces of one slice, which may be in a file and larger than the memory.

    Replaces an array (ntx, nrx, nt) of ``Waveform`` where single emissions are read.

    Attributes:
        read: returns the recorded traces of an emission, (nrx, nt).
        samples: of each trace.
        dtype: int16 or float32.
        emission: (ntx,), index of the recorded emission of each one.
        reception: (nrx,), the same for receptions.
        inverted: (ntx, nrx), traces recorded with inverted polarity.
    """

    read: Callable[[int], NDArray[Any]]
    samples: int
    dtype: np.dtype[Any]
    emission: Ints
    reception: Ints
    inverted: Flags
    ndim: ClassVar[int] = 3

    @classmethod
    def from_reader(
        cls, read: Callable[[int], NDArray[Any]], shape: tuple[int, int, int], dtype: np.dtype[Any]
    ) -> Emissions:
        """All recorded traces, unchanged."""
        ntx, nrx, samples = shape
        return cls(read, samples, dtype, np.arange(ntx), np.arange(nrx), np.zeros((ntx, nrx), dtype=bool))

    @property
    def shape(self) -> tuple[int, int, int]:
        return len(self.emission), len(self.reception), self.samples

    def __len__(self) -> int:
        return len(self.emission)

    def __getitem__(self, e: int) -> NDArray[Any]:
        """The traces of one emission, (nrx, nt)."""
        traces = self.read(int(self.emission[e]))
        if (self.reception != np.arange(len(self.reception))).any():
            traces = traces[self.reception]
        return negate(traces, self.inverted[e]) if self.inverted[e].any() else traces

    def __iter__(self) -> Iterator[NDArray[Any]]:
        return (self[e] for e in range(len(self)))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        array = np.empty(self.shape, dtype or self.dtype)
        for e, traces in enumerate(self):
            array[e] = traces
        return array


def reorder_channels(traces: Any, order: Ints, axis: int) -> Any:
    """Channels of an array or ``Emissions`` in another order."""
    if not isinstance(traces, Emissions):
        return np.take(traces, order, axis=axis)
    name = ("emission", "reception")[axis]
    changed: dict[str, Any] = {name: getattr(traces, name)[order]}
    return replace(traces, **changed, inverted=np.take(traces.inverted, order, axis=axis))


def invert_polarity(traces: Any, where: Flags) -> Any:
    """Traces of an array or ``Emissions`` with inverted polarity where ``where``, (ntx, nrx), is true."""
    if isinstance(traces, Emissions):
        return replace(traces, inverted=traces.inverted ^ where)
    return negate(traces, where)


def negate(traces: NDArray[Any], where: Flags) -> NDArray[Any]:
    """A copy with the opposite sign where ``where``, of all axes except the last, is true."""
    inverted = traces.copy()
    # The lowest integer has no opposite.
    lowest = np.iinfo(inverted.dtype).min + 1 if inverted.dtype.kind == "i" else -np.inf
    inverted[where] = -np.maximum(inverted[where], lowest)
    return inverted

"""Traces that are read an emission at a time; channels are exchanged and turned over as they are read."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Flags, Ints


@dataclass(frozen=True)
class Emissions:
    """The traces of one slice, which may lie in a file and be larger than the memory.

    Stands where ``Waveform`` has an array (ntx, nrx, nt) of which single emissions are asked for.

    Attributes:
        read: gives the traces of an emission as it was recorded, (nrx, nt).
        samples: of each trace.
        dtype: int16 or float32.
        emission: (ntx,), which of the recorded ones each emission is.
        reception: (nrx,), the same of the receptions.
        down: (ntx, nrx), which traces are recorded upside down.
    """

    read: Callable[[int], NDArray[Any]]
    samples: int
    dtype: np.dtype[Any]
    emission: Ints
    reception: Ints
    down: Flags

    @classmethod
    def of(
        cls, read: Callable[[int], NDArray[Any]], shape: tuple[int, int, int], dtype: np.dtype[Any]
    ) -> Emissions:
        """As they were recorded."""
        ntx, nrx, samples = shape
        return cls(read, samples, dtype, np.arange(ntx), np.arange(nrx), np.zeros((ntx, nrx), dtype=bool))

    @property
    def shape(self) -> tuple[int, int, int]:
        return len(self.emission), len(self.reception), self.samples

    @property
    def ndim(self) -> int:
        return 3

    def __len__(self) -> int:
        return len(self.emission)

    def __getitem__(self, e: int) -> NDArray[Any]:
        """The traces of one emission, (nrx, nt)."""
        found = self.read(int(self.emission[e]))
        if (self.reception != np.arange(len(self.reception))).any():
            found = found[self.reception]
        return over(found, self.down[e]) if self.down[e].any() else found

    def __iter__(self) -> Iterator[NDArray[Any]]:
        return (self[e] for e in range(len(self)))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        found = np.empty(self.shape, dtype or self.dtype)
        for e, traces in enumerate(self):
            found[e] = traces
        return found


def moved(traces: Any, order: Ints, axis: int) -> Any:
    """Channels of an array, or of ``Emissions``, in another order."""
    if not isinstance(traces, Emissions):
        return np.take(traces, order, axis=axis)
    name = ("emission", "reception")[axis]
    changed: dict[str, Any] = {name: getattr(traces, name)[order]}
    return replace(traces, **changed, down=np.take(traces.down, order, axis=axis))


def turned(traces: Any, where: Flags) -> Any:
    """Traces of an array, or of ``Emissions``, with some turned over; ``where`` is (ntx, nrx)."""
    if isinstance(traces, Emissions):
        return replace(traces, down=traces.down ^ where)
    return over(traces, where)


def over(traces: NDArray[Any], where: Flags) -> NDArray[Any]:
    """A copy with the opposite sign at some places of all axes but the last."""
    found = traces.copy()
    # The lowest whole number has no opposite.
    lowest = np.iinfo(found.dtype).min + 1 if found.dtype.kind == "i" else -np.inf
    found[where] = -np.maximum(found[where], lowest)
    return found

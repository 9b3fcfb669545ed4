"""The traces of one slice in the memory of this process, for tasks of a reflection image."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ...acquisition import Dataset


class MemoryEchoScan:
    """See ``reflection_plan.EchoScan``."""

    def __init__(self, dataset: Dataset, index: int) -> None:
        self._slice = dataset.slice(index)

    @contextmanager
    def open(self) -> Iterator[Dataset]:
        yield self._slice

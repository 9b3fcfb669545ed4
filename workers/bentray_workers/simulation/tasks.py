"""Parts of a simulated scan, a task each: cut, computed into files, and read back in order."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.sources import digest
from bentray_kernels.wave.time_blocks import Poll

from ..cluster.attempts import ResultsLostError
from ..cluster.checkpoints import UNREADABLE
from ..cluster.job_cancellation import Unwanted, check_wanted
from ..files.atomic import replacing
from ..files.npy_headers import PARSING
from .cost import emitters_a_task
from .emitter_batches import simulate_emitters
from .request import Simulated
from .waves import WaveSimulationSettings, simulate_emission

# What the numbers of a part depend on.
MODULES = (
    "bentray_kernels.acquisition.simulation.fine_medium",
    "bentray_kernels.acquisition.simulation.ring_scan",
    "bentray_kernels.acquisition.simulation.volume_scan",
    "bentray_kernels.phantoms",
    "bentray_kernels.wave.simulation",
)


@dataclass(frozen=True)
class Part:
    """Emitters of one scan, from ``first`` to before ``last``; a wave's part is one emission."""

    scan: int
    first: int
    last: int

    def path(self, folder: Path) -> Path:
        """Its file."""
        return folder / f"part-{self.scan:04d}-{self.first:05d}.npz"


def parts_of(settings: Simulated) -> list[Part]:
    """All of them, in order, each about a second of work where an emitter is no more than that."""
    if isinstance(settings, WaveSimulationSettings):
        return [Part(0, k, k + 1) for k in range(settings.emissions)]
    step, count = emitters_a_task(settings), settings.emitters
    return [
        Part(scan, first, min(first + step, count))
        for scan in range(settings.scans)
        for first in range(0, count, step)
    ]


def count_of(settings: Simulated) -> int:
    """How many parts there are, without making any."""
    if isinstance(settings, WaveSimulationSettings):
        return settings.emissions
    return settings.scans * -(-settings.emitters // emitters_a_task(settings))


def folder_of(work_dir: Path) -> Path:
    """Where the parts of a job are; those of other kernels than the present ones are in another folder."""
    version = "".join(digest(module)[:6] for module in MODULES)
    return work_dir / f"parts-{version}"


def make_part(settings: Simulated, part: Part, folder: Path) -> None:
    """Task: compute a part into its file. It ends within a second, without one, once the folder has gone."""
    try:
        arrays = _computed(settings, part, partial(check_wanted, folder))
        with replacing(part.path(folder)) as unready, unready.open("wb") as file:
            np.savez(file, allow_pickle=False, **{str(k): array for k, array in enumerate(arrays)})
    except Unwanted:
        return
    except FileNotFoundError:
        # The job was cancelled, and nobody waits for this.
        if folder.exists():
            raise


def _computed(settings: Simulated, part: Part, poll: Poll) -> list[NDArray[Any]]:
    """Rows of the emitters: travel times and losses, or traces of object and water."""
    if isinstance(settings, WaveSimulationSettings):
        return list(simulate_emission(settings, part.first, poll))
    rows: list[list[NDArray[Any]]] = []
    for emitter in range(part.first, part.last):
        poll()
        received = simulate_emitters(settings, part.scan, np.array([emitter]))
        rows.append([array for array in received if array is not None])
    return [np.concatenate(arrays) for arrays in zip(*rows, strict=True)]


def read_part(part: Part, folder: Path) -> list[NDArray[Any]]:
    """What ``make_part`` kept, checked against the sums in the file.

    Raises:
        ResultsLostError: for a damaged file, which is removed, so that the part is made again.
    """
    path = part.path(folder)
    try:
        with PARSING, np.load(path, allow_pickle=False) as found:
            return [found[str(k)] for k in range(len(found.files))]
    except UNREADABLE as error:
        path.unlink(missing_ok=True)
        raise ResultsLostError(f"{path.name} is damaged: {error}") from None


def missing(parts: list[Part], folder: Path) -> Iterator[Part]:
    """Those without a file."""
    there = {path.name for path in folder.iterdir()}
    return (part for part in parts if part.path(folder).name not in there)

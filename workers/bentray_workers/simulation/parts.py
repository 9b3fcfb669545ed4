"""Parts of a simulated scan, one task each: emitters computed into a file, and read back."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.acquisition.simulation.fine_medium import FineMedium
from bentray_kernels.compilation.sources import digest
from bentray_kernels.wave.time_blocks import Poll

from ..cluster.checkpoints import UNREADABLE
from ..cluster.job_cancellation import JobEnded, check_job_active
from ..cluster.task_retries import ResultsLostError
from ..files.atomic import atomic_replace
from ..files.npy_headers import PARSING
from .cost import Timed, emitters_a_task
from .kinds import Simulated
from .shared_media import made_once
from .waves import WaveSimulationSettings, simulate_emission

# Modules that determine the values of a part.
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
    """All parts in order, each about a second of work, or one emitter that takes longer."""
    if isinstance(settings, WaveSimulationSettings):
        return [Part(0, k, k + 1) for k in range(settings.emissions)]
    step, count = emitters_a_task(settings), settings.emitters
    return [
        Part(scan, first, min(first + step, count))
        for scan in range(settings.scans)
        for first in range(0, count, step)
    ]


def count_of(settings: Simulated) -> int:
    """Number of parts, without making a list of them."""
    if isinstance(settings, WaveSimulationSettings):
        return settings.emissions
    return settings.scans * -(-settings.emitters // emitters_a_task(settings))


def folder_of(work_dir: Path) -> Path:
    """Folder of the parts of a job; parts of another version of the kernels are in another folder."""
    version = "".join(digest(module)[:6] for module in MODULES)
    return work_dir / f"parts-{version}"


def make_part(settings: Simulated, part: Part, folder: Path) -> None:
    """Task: compute a part into its file. Ends within a second once the folder is gone."""
    try:
        arrays = _computed(settings, part, partial(check_job_active, folder))
        with atomic_replace(part.path(folder)) as unready, unready.open("wb") as file:
            np.savez(file, allow_pickle=False, **{str(k): array for k, array in enumerate(arrays)})
    except JobEnded:
        return
    except FileNotFoundError:
        # The job was cancelled.
        if folder.exists():
            raise


def _computed(settings: Simulated, part: Part, poll: Poll) -> list[NDArray[Any]]:
    """Rows of the emitters: travel times and losses, or traces of object and water."""
    if isinstance(settings, WaveSimulationSettings):
        return list(simulate_emission(settings, part.first, poll))
    rows: list[list[NDArray[Any]]] = []
    for emitter in range(part.first, part.last):
        poll()
        medium = _medium(settings, settings.medium_number(part.scan))
        received = medium.arrivals(settings.elements_in_medium(part.scan), np.array([emitter]))
        rows.append([array for array in received if array is not None])
    return [np.concatenate(arrays) for arrays in zip(*rows, strict=True)]


@made_once(2)
def _medium(settings: Timed, number: int) -> FineMedium:
    return settings.medium(number)


def read_part(part: Part, folder: Path) -> list[NDArray[Any]]:
    """The arrays of a part, checked against the check sums in the file.

    Raises:
        ResultsLostError: for a damaged file; it is removed, so that the part is computed again.
    """
    path = part.path(folder)
    try:
        with PARSING, np.load(path, allow_pickle=False) as archive:
            return [archive[str(k)] for k in range(len(archive.files))]
    except UNREADABLE as error:
        path.unlink(missing_ok=True)
        raise ResultsLostError(f"{path.name} is damaged: {error}") from None


def missing(parts: list[Part], folder: Path) -> Iterator[Part]:
    """Parts without a file."""
    there = {path.name for path in folder.iterdir()}
    return (part for part in parts if part.path(folder).name not in there)

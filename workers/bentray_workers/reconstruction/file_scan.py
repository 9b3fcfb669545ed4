"""A scan in a file, for tasks: every process reads it once."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.quality.correction import apply
from bentray_kernels.tomography.scan import problem_of, problems_of, stages_of
from bentray_kernels.tomography.waveform.wave_scan import wave_problem_of

from ..cluster.job_cancellation import check_job_active
from ..files.dataset.scan import ScanHeader, open_slice, read_header
from ..files.picking_files import read_findings, reference_path, with_reference
from .ray_sizes import PROBLEMS_KEPT

# How many values of each kind a process keeps. Two jobs may alternate; more problems of waves would cost
# memory, since they hold the traces of the object. Slices that a device updates together are of one job.
KEPT: dict[Callable[..., Any], int] = {
    stages_of: 16,
    problem_of: PROBLEMS_KEPT,
    problems_of: 1,
    wave_problem_of: 2,
}
_MADE: dict[Callable[..., Any], Callable[..., Any]] = {
    make: lru_cache(maxsize=most)(make) for make, most in KEPT.items()
}


class FileSource(NamedTuple):
    """See ``tomography.scan.Source``; stamps distinguish a rewritten file from the old one.

    Attributes:
        path: of a file with travel times.
        stamp: of this file.
        recorded: the file with the traces.
        recorded_stamp: of that file.
        findings: the file of findings in the scan; faulty traces are corrected or left out. Tasks end within
            a second once its folder, that of the job, is removed.
        water_temperature_c: in place of that of the file, °C.
    """

    path: Path
    stamp: int
    recorded: Path
    recorded_stamp: int
    findings: Path
    water_temperature_c: float | None = None

    @property
    def samples(self) -> int:
        return read_once(self.recorded, self.recorded_stamp).samples

    @property
    def estimates_source(self) -> bool:
        return read_once(self.recorded, self.recorded_stamp).lacks_water

    @property
    def has_water(self) -> bool:
        # A scan with travel times and without a water shot has no estimated one, unless waves are requested.
        return not self.estimates_source or reference_path(self.findings.parent, 0).exists()

    @property
    def poll(self) -> Callable[[], None]:
        return partial(check_job_active, self.findings.parent)

    def dataset(self) -> Dataset:
        return read_once(self.path, self.stamp, self.water_temperature_c).dataset

    @contextmanager
    def traces(self, index: int, *, estimated_water: bool = False) -> Iterator[Dataset]:
        faults = read_findings(self.findings).of_traces(index)
        whole = read_once(self.recorded, self.recorded_stamp, self.water_temperature_c).dataset
        with open_slice(self.recorded, whole, index, self.poll) as dataset:
            put_right = apply(dataset, faults)
            yield with_reference(put_right, self.findings.parent, index) if estimated_water else put_right

    def once(self, make: Callable[..., Any], /, *arguments: Any) -> Any:
        return _MADE[make](*arguments)


def read_once(path: Path, stamp: int, water_temperature_c: float | None = None) -> ScanHeader:
    """Facts about a scan without its traces.

    Args:
        path: of its file.
        stamp: distinguishes a rewritten file from the old one.
        water_temperature_c: in place of that of the file, °C; a file picked from it states it already.
    """
    return _read(path, stamp) if water_temperature_c is None else _in_water(path, stamp, water_temperature_c)


@lru_cache(maxsize=2)
def _read(path: Path, _stamp: int) -> ScanHeader:
    # Before the first task, the run held the times against the positions.
    return read_header(path, plausible=False)


@lru_cache(maxsize=2)
def _in_water(path: Path, stamp: int, temperature_c: float) -> ScanHeader:
    header = _read(path, stamp)
    return header._replace(dataset=header.dataset.in_water_of(temperature_c))

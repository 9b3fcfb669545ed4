"""The quality report of a dataset file: what was found, and a page; traces are read an emission at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.calibration import Calibration, calibrate, water_times
from bentray_kernels.acquisition.quality import Report, examine_slices
from bentray_kernels.acquisition.quality.correction import apply
from bentray_kernels.errors import InvalidInput

from ..cluster.task_cancellation import cancellation_check
from ..files.dataset import Limits, read_dataset
from ..files.dataset.read import NUMERIC, TRACES
from ..files.dataset.traces import slice_opened
from ..files.hdf5_reading import opened

# Told (emissions gone through, in all).
Told = Callable[[int, int], None]


@dataclass(frozen=True)
class Quality:
    """What a scan's examination gives.

    Attributes:
        report: plain values for JSON, see ``acquisition.quality.Report``.
        page: PNG about the slice with the most findings.
        picked: what goes on, with travel times; None for a refused scan.
        examined: the report as it was made.
    """

    report: dict[str, Any]
    page: bytes
    picked: Dataset | None
    examined: Report


# Traces that a task examines while somebody waits, bytes: it takes a core half a minute.
LARGEST_BYTES = 2**30


def calibrate_file(
    path: Path, picker: str, progress: Told | None = None, *, fit_speed: bool
) -> tuple[Quality, Calibration | None]:
    """Examine a dataset file, and calibrate its array from the water shot of its first slice.

    Args:
        path: of the file.
        picker: what reads times that are not there.
        progress: of the examination.
        fit_speed: whether the size of the array is trusted more than the speed of the water.

    Returns:
        The examination, ``picked`` with the elements and the water of the calibration; and this, None for a
        refused scan.

    Raises:
        InvalidInput: as ``examine_file``, and for a scan without a water shot.
    """
    whole = read_dataset(path, traces=False)
    quality = _examined(path, whole, picker, progress)
    if quality.picked is None:
        return quality, None
    with slice_opened(path, whole, 0) as one:
        right = apply(one, [finding for finding in quality.examined.findings if finding.slice == 0])
        found = calibrate(right, water_times(right), fit_speed=fit_speed)
    return replace(quality, picked=found.applied(quality.picked)), found


def examine_file(
    path: Path, picker: str = "aic", progress: Told | None = None, largest_bytes: int | None = None
) -> Quality:
    """Examine a dataset file.

    Args:
        path: of the file.
        picker: what reads times that are not there.
        progress: called after each emission, as often as its traces are looked at.
        largest_bytes: of traces; None: as many as there are, for they are never in memory together.

    Raises:
        InvalidInput: from the file, for an unknown picker, or for more traces than allowed.
    """
    if largest_bytes is not None:
        _check_size(path, largest_bytes)
    return _examined(path, read_dataset(path, traces=False), picker, progress)


def _examined(path: Path, whole: Dataset, picker: str, progress: Told | None) -> Quality:
    # Matplotlib comes with it, which the service, that only hands the task out, need not hold.
    from ..images.quality_page import quality_png

    examined = examine_slices(whole, _slices(path, whole), picker, progress)
    of_slices = [f.slice for f in examined.report.findings]
    worst = max(set(of_slices), key=of_slices.count, default=0)
    with slice_opened(path, whole, worst) as one:
        page = quality_png(one, examined, worst if whole.slice_z_m is not None else None)
    return Quality(examined.report.to_dict(), page, examined.picked, examined.report)


def _slices(path: Path, whole: Dataset) -> Iterator[Dataset]:
    """Each slice, its traces readable until the next is asked for."""
    for index in range(whole.slices):
        with slice_opened(path, whole, index) as one:
            yield one


def quality_report(path: Path, picker: str) -> dict[str, Any]:
    """Task: the report alone."""
    return _waited_for(path, picker).report


def quality_page(path: Path, picker: str) -> bytes:
    """Task: the page alone."""
    return _waited_for(path, picker).page


def _waited_for(path: Path, picker: str) -> Quality:
    """An examination that ends early when nobody waits for it any more."""
    check = cancellation_check()
    return examine_file(path, picker, lambda done, total: check(), LARGEST_BYTES)


def _check_size(path: Path, largest_bytes: int) -> None:
    with opened(path, Limits()) as reader:
        found = [reader.checked(f"waveform/{name}", NUMERIC, TRACES) for name in ("object", "water")]
        size = sum(math.prod(one.shape) * one.dtype.itemsize for one in found if one is not None)
    if size > largest_bytes:
        raise InvalidInput(
            "dataset", f"{size} bytes of traces", f"at most {largest_bytes}; bentray quality takes more"
        )

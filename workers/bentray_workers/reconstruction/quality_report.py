"""Quality report of a dataset file: findings and a page; traces are read one emission at a time."""

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.calibration import Calibration, calibrate, water_times
from bentray_kernels.acquisition.pulse_spectrum import PulseSpectrum
from bentray_kernels.acquisition.quality import Examined, Finding, Report, examine
from bentray_kernels.acquisition.quality.correction import apply
from bentray_kernels.acquisition.quality.water_speed import WATER_SPEED
from bentray_kernels.acquisition.water import temperature_from_speed
from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.limits import MAX_LEFT_OUT
from bentray_kernels.requests.names import DEFAULT_PICKER

from ..cluster.task_cancellation import cancellation_check
from ..files.dataset.read import NUMERIC, TRACES
from ..files.dataset.scan import open_slice, read_header
from ..files.hdf5_reading import opened

# Called with the number of examined emissions, and of all.
OnEmission = Callable[[int, int], None]


@dataclass(frozen=True)
class Quality:
    """Result of the examination of a scan.

    Attributes:
        report: plain values for JSON, see ``acquisition.quality.Report``.
        page: PNG about the slice with the most findings; empty if it was not requested.
        picked: the corrected dataset with travel times; None for a rejected scan.
        examined: the report itself.
    """

    report: dict[str, Any]
    page: bytes
    picked: Dataset | None
    examined: Report


# Largest traces of an interactive examination, bytes: half a minute of a core.
LARGEST_BYTES = 2**30


def calibrate_file(
    path: Path,
    picker: str,
    progress: OnEmission | None = None,
    *,
    fit_speed: bool,
    max_left_out: float = MAX_LEFT_OUT,
) -> tuple[Quality, Calibration | None]:
    """Examine a dataset file, and calibrate its array from the water shot of its first slice.

    Args:
        path: of the file.
        picker: for datasets without travel times.
        progress: of the examination.
        fit_speed: fit the speed of sound in water instead of the size of the array.
        max_left_out: share of the pairs beyond which the scan is refused.

    Returns:
        The examination, with the elements and the water of the calibration in ``picked``; and the
        calibration, None for a rejected scan.

    Raises:
        InvalidInput: as ``examine_file``, and for a scan without a water shot.
    """
    header = read_header(path)
    whole = header.dataset
    quality = _examined(path, whole, header.spectrum, picker, progress, max_left_out=max_left_out)
    if quality.picked is None:
        return quality, None
    with open_slice(path, whole, 0) as dataset:
        right = apply(dataset, [finding for finding in quality.examined.findings if finding.slice == 0])
        calibration = calibrate(right, water_times(right), fit_speed=fit_speed)
    return replace(quality, picked=calibration.applied(quality.picked)), calibration


def examine_file(
    path: Path,
    picker: str = DEFAULT_PICKER,
    progress: OnEmission | None = None,
    largest_bytes: int | None = None,
    water_temperature_c: float | None = None,
    *,
    draw: bool = True,
    max_left_out: float = MAX_LEFT_OUT,
) -> Quality:
    """Examine a dataset file.

    Args:
        path: of the file.
        picker: for datasets without travel times.
        progress: called after each emission, in each pass over the traces.
        largest_bytes: of traces; None: no limit, since they are never all in memory.
        water_temperature_c: in place of that of the file, °C.
        draw: make the page, which takes longer than the report of a small scan.
        max_left_out: share of the pairs beyond which the scan is refused.

    Raises:
        InvalidInput: from the file, for an unknown picker, or for more traces than allowed.
    """
    if largest_bytes is not None:
        _check_size(path, largest_bytes)
    header = read_header(path)
    whole, spectrum = header.dataset.in_water_of(water_temperature_c), header.spectrum
    return _examined(path, whole, spectrum, picker, progress, draw=draw, max_left_out=max_left_out)


def _examined(
    path: Path,
    whole: Dataset,
    spectrum: PulseSpectrum | None,
    picker: str,
    progress: OnEmission | None,
    *,
    draw: bool = True,
    max_left_out: float,
) -> Quality:
    examined = examine(whole, picker, progress, max_left_out, _slices(path, whole))
    if spectrum is not None:
        findings = (_estimated_frequency(spectrum), *examined.report.findings)
        examined = replace(examined, report=replace(examined.report, findings=findings))
    page = _drawn(path, whole, examined) if draw else b""
    return Quality(_plain(examined.report), page, examined.picked, examined.report)


def _plain(report: Report) -> dict[str, Any]:
    """Plain values, with the temperature at which water has the speed that is only reported."""
    record = report.to_dict()
    for plain, finding in zip(record["findings"], report.findings, strict=True):
        if finding.check == WATER_SPEED and finding.action == "reported":
            # Of another medium there is none.
            with suppress(InvalidInput):
                plain["water_temperature_c"] = round(temperature_from_speed(finding.value), 2)
    return record


def _drawn(path: Path, whole: Dataset, examined: Examined) -> bytes:
    # It loads Matplotlib, which the service, where the task is only submitted, does not need.
    from ..images.quality_page import quality_png

    of_slices = [f.slice for f in examined.report.findings]
    worst = max(set(of_slices), key=of_slices.count, default=0)
    with open_slice(path, whole, worst) as dataset:
        return quality_png(dataset, examined, worst if whole.slice_z_m is not None else None)


def _estimated_frequency(spectrum: PulseSpectrum) -> Finding:
    """The finding that the file has no centre frequency, and it was estimated."""
    accepted, value = "acquisition@center_frequency_hz", spectrum.center_frequency_hz
    return Finding("centre frequency", spectrum.summary, accepted, "reported", value=value, unit="Hz")


def _slices(path: Path, whole: Dataset) -> Iterator[Dataset]:
    """Each slice, with traces that are readable until the next one."""
    for index in range(whole.slices):
        with open_slice(path, whole, index) as dataset:
            yield dataset


def quality_report(path: Path, picker: str, water_temperature_c: float | None = None) -> dict[str, Any]:
    """Task: the report alone."""
    return _cancellable(path, picker, water_temperature_c, draw=False).report


def quality_page(path: Path, picker: str, water_temperature_c: float | None = None) -> bytes:
    """Task: the page alone."""
    return _cancellable(path, picker, water_temperature_c, draw=True).page


def _cancellable(path: Path, picker: str, water_temperature_c: float | None, *, draw: bool) -> Quality:
    """An examination that ends early when its task is cancelled."""
    check = cancellation_check()
    return examine_file(
        path, picker, lambda done, total: check(), LARGEST_BYTES, water_temperature_c, draw=draw
    )


def _check_size(path: Path, largest_bytes: int) -> None:
    with opened(path) as reader:
        stored = [reader.checked(f"waveform/{name}", NUMERIC, TRACES) for name in ("object", "water")]
        size = sum(math.prod(array.shape) * array.dtype.itemsize for array in stored if array is not None)
    if size > largest_bytes:
        raise InvalidInput(
            "dataset", f"{size} bytes of traces", f"at most {largest_bytes}; bentray quality has no limit"
        )

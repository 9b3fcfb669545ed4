"""Counts of a dataset file, without reading the arrays over its pairs.

Of a scan without a centre frequency, some emissions are read to estimate it.
"""

from __future__ import annotations

import math
from contextlib import suppress
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.limits import check_size
from bentray_kernels.tomography.settings import Settings

from ..hdf5_reading import Limits, Reader, opened
from .counts import DatasetCounts, Summary, array_counts
from .read import NUMERIC, trace_type
from .scan import spectrum_in
from .traces import samples_in


def counts_in(path: Path) -> DatasetCounts:
    """Counts of a dataset file in canonical form.

    Args:
        path: of the HDF5 file.

    Raises:
        InvalidInput: for a file without positions, emitters or receivers, or with too many.
    """
    with opened(path, Limits()) as reader:
        position, tx, rx = (
            _sized(reader, path)
            for path in ("geometry/element_position_m", "acquisition/tx", "acquisition/rx")
        )
        heights = _sized(reader, "slice/z_m") if reader.has("slice/z_m") else None
        received = reader.checked("waveform/object", NUMERIC, "traces")
        water = reader.number("water", "sound_speed_mps", "m/s")
        frequency = reader.number("acquisition", "center_frequency_hz", "Hz")
        if frequency is None:
            # Traces without a pulse are rejected when they are read, not when they are counted.
            with suppress(InvalidInput):
                spectrum = spectrum_in(reader, stacked=heights is not None)
                frequency = None if spectrum is None else spectrum.center_frequency_hz
        return DatasetCounts(
            **array_counts(position, tx, rx, heights),
            times=any(_bytes(reader, f"traveltime/{name}") for name in ("delta_tof_s", "tof_s")),
            amplitudes=_bytes(reader, "amplitude/log_ratio_np") > 0,
            traces_bytes=sum(_bytes(reader, f"waveform/{name}") for name in ("object", "water")),
            samples=samples_in(reader),
            sample_bytes=0 if received is None else trace_type(received.dtype).itemsize,
            rate_hz=reader.number("acquisition", "sampling_rate_hz", "Hz"),
            frequency_hz=frequency,
            # The speed hardly affects sizes.
            water_mps=1500.0 if water is None else water,
            water_shot=_bytes(reader, "waveform/water") > 0,
            normals=reader.has("geometry/element_normal"),
        )


def summary_of(path: Path, settings: Settings) -> Summary:
    """Like ``counts_in``, for the plan of a reconstruction."""
    return counts_in(path).summary(settings)


def _sized(reader: Reader, path: str) -> NDArray[Any]:
    """An array, whose size is checked before it is read."""
    declared = reader.checked(path, NUMERIC, "numbers")
    check_size(path, () if declared is None else declared.shape)
    return reader.required(path, NUMERIC, "numbers")


def _bytes(reader: Reader, path: str) -> int:
    stored = reader.checked(path, NUMERIC, "numbers")
    return 0 if stored is None else math.prod(stored.shape) * stored.dtype.itemsize

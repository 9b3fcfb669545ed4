"""What a plan needs to know of a dataset file, read without the arrays over its pairs."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography.settings import Settings

from .dataset_reading import NUMERIC
from .hdf5_reading import Limits, Reader, opened
from .task_memory import Summary
from .trace_reading import samples_in
from .wave_memory import Traces


def summary_of(path: Path, settings: Settings) -> Summary:
    """The summary of a dataset that has been read before.

    Args:
        path: of the HDF5 file.
        settings: with ``reciprocity``, elements that only send or only receive do both; and whether
            amplitudes are read from traces.

    Raises:
        InvalidInput: for a file without positions, emitters or receivers.
    """
    with opened(path, Limits()) as reader:
        position = _wanted(reader, "geometry/element_position_m")
        tx, rx = (_wanted(reader, f"acquisition/{name}") for name in ("tx", "rx"))
        z = reader.array("slice/z_m", NUMERIC, "(nz,) numbers in m")
        times = any(_bytes(reader, f"traveltime/{name}") for name in ("delta_tof_s", "tof_s"))
        traces = sum(_bytes(reader, f"waveform/{name}") for name in ("object", "water"))
        amplitudes = _bytes(reader, "amplitude/log_ratio_np") > 0
        waves = _traces(reader, len(tx), len(rx))
        frequency = reader.number("acquisition", "center_frequency_hz", "Hz")
    slices = 1 if z is None else len(z)
    heights = position[:, 2] if position.shape[1] == 3 else np.zeros(1) if z is None else z
    elements = len(np.union1d(tx, rx))
    emitters, receivers = (elements, elements) if settings.reciprocity else (len(tx), len(rx))
    return Summary(
        emitters=emitters,
        receivers=receivers,
        pairs=slices * len(tx) * len(rx),
        slices=slices,
        in_space=position.shape[1] == 3,
        height_m=float(np.ptp(heights)),
        width_m=float(np.ptp(position[:, :2], axis=0).max()),
        traces_bytes=0 if times and not settings.listens else traces,
        amplitudes=amplitudes or settings.listens,
        traces=waves,
        period=frequency is not None,
    )


def _traces(reader: Reader, emissions: int, receivers: int) -> Traces | None:
    samples = samples_in(reader)
    rate, centre = (
        reader.number("acquisition", name, "Hz") for name in ("sampling_rate_hz", "center_frequency_hz")
    )
    if not samples or rate is None or centre is None:
        return None
    # As far as sizes go all waters are alike.
    water = reader.number("water", "sound_speed_mps", "m/s") or 1500.0
    received = reader.checked("waveform/object", NUMERIC, "traces")
    size = 2 if received is not None and received.dtype.kind != "f" else 4
    return Traces(emissions, receivers, samples, size, rate, centre, water)


def _wanted(reader: Reader, path: str) -> np.ndarray:
    found = reader.array(path, NUMERIC, "numbers")
    if found is None:
        raise InvalidInput(path, "nothing", "numbers")
    return found


def _bytes(reader: Reader, path: str) -> int:
    found = reader.checked(path, NUMERIC, "numbers")
    return 0 if found is None else math.prod(found.shape) * found.dtype.itemsize

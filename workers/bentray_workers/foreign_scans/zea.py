"""Scans in the format of zea and OpenH-RF: HDF5 with ``raw_data`` and transmit parameters.

Source:
    ``zea/data/spec.py`` of github.com/tue-bmd/zea (``DataSpec``, ``ScanSpec``); the data cards of OpenH-RF
    for the group ``probe``.
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.limits import check_size

from ..files.damage import ACCEPTED
from ..files.hdf5_reading import Reader
from .arrays import StreamedScan, Traces
from .matlab import rows_of
from .open_scan import OpenScan, ScanReader, Variable

# Place of the groups ``data`` and ``scan``: of files of one track, and of files with several.
TRACKS = ("", "tracks/track_0/")
RAW = "data/raw_data"
RAW_SHAPE = "(n_frames, n_tx, n_ax, n_el, n_ch) numbers"

# Apodizations below this part of the largest do not emit.
SILENT = 1e-3
# Differences between the delays or start times of emissions, relative to a sample.
SAME_TIME = 0.01
# Planes of elements: coordinates within this part of the array's width are equal.
FLAT = 1e-6


def _detect(scan: OpenScan) -> bool:
    return any(scan.has(track + RAW, f"{track}scan/sampling_frequency") for track in TRACKS)


def _read(scan: OpenScan) -> StreamedScan:
    assert scan.hdf5 is not None
    reader = scan.hdf5
    track = next(track for track in TRACKS if scan.has(track + RAW))
    if scan.has("tracks/track_1"):
        raise InvalidInput("tracks", "several tracks", "a file with one track")
    raw = reader.checked(track + RAW, "iuf", RAW_SHAPE)
    assert raw is not None
    if raw.ndim != 5 or 0 in raw.shape:
        raise InvalidInput(track + RAW, f"shape {raw.shape}", RAW_SHAPE)
    frames, emissions, samples, elements, channels = raw.shape
    if frames != 1 or channels != 1:
        given = f"{frames} frames and {channels} channels (shape {raw.shape})"
        accepted = f"one frame of radio-frequency data (n_frames 1, n_ch 1); {ACCEPTED}"
        raise InvalidInput(track + RAW, given, accepted)
    field = _Fields(reader, track)
    position = field.numbers("probe_geometry", (elements, 3), "m")
    rate = field.number("sampling_frequency", "Hz")
    emitters = _emitters(field, (emissions, elements))
    delays = field.numbers("t0_delays", (emissions, elements), "s")
    starts = field.numbers("initial_times", (emissions,), "s")
    # The clock of the samples begins with the first firing element, here the only one.
    first = starts - delays[np.arange(emissions), emitters]
    if not np.isfinite(first).all() or np.ptp(first) * rate > SAME_TIME:
        given = f"{first.min():g} to {first.max():g} s after the emission"
        raise InvalidInput(f"{track}scan/initial_times", given, "the same time for every emission")
    speed = field.optional("sound_speed", "m/s")
    frequency = field.optional("center_frequency", "Hz", of_emissions=emissions)

    def traces() -> Iterator[NDArray[Any]]:
        for emission in rows_of(raw, track + RAW, (0,)):
            yield np.ascontiguousarray(emission[:, :, 0].T)

    return StreamedScan(
        "zea",
        {
            "geometry/element_position_m": _in_plane(position),
            "acquisition/tx": emitters,
            "acquisition/rx": np.arange(elements),
            "acquisition/sampling_rate_hz": rate,
            "acquisition/t0_s": float(first[0]),
            "acquisition/center_frequency_hz": frequency,
            "water/sound_speed_mps": speed,
        },
        {"waveform/object": Traces((emissions, elements, samples), raw.dtype, traces)},
    )


class _Fields:
    """Fields of the group ``scan``, with their sizes checked before they are read."""

    def __init__(self, reader: Reader, track: str) -> None:
        self._reader = reader
        self._track = track

    def path(self, name: str) -> str:
        """The path of a field: positions are in the group ``probe`` of newer files."""
        paths = (f"{self._track}scan/{name}", f"probe/{name}", f"{self._track}probe/{name}")
        return next((path for path in paths if self._reader.has(path)), paths[0])

    def numbers(self, name: str, shape: tuple[int, ...], unit: str) -> NDArray[np.float64]:
        """An array of numbers that must be present."""
        path, accepted = self.path(name), f"{shape} numbers in {unit}"
        if name == "probe_geometry":
            check_size("geometry/element_position_m", shape, path)
        stored = self._reader.checked(path, "f", accepted)
        if stored is None or stored.shape != shape:
            given = "nothing" if stored is None else f"shape {stored.shape}"
            raise InvalidInput(path, given, accepted)
        return np.asarray(self._reader.required(path, "f", accepted), dtype=np.float64)

    def number(self, name: str, unit: str) -> float:
        """A number that must be present."""
        value = self.optional(name, unit)
        if value is None:
            raise InvalidInput(self.path(name), "nothing", f"a number in {unit}")
        return value

    def optional(self, name: str, unit: str, of_emissions: int = 1) -> float | None:
        """A number, or the mean of one per emission, or None."""
        path, accepted = self.path(name), f"one finite number in {unit}"
        stored = self._reader.checked(path, "iuf", accepted)
        if stored is None:
            return None
        if math.prod(stored.shape) not in (1, of_emissions):
            raise InvalidInput(path, f"shape {stored.shape}", accepted)
        values = np.asarray(self._reader.required(path, "iuf", accepted), dtype=np.float64)
        if not np.isfinite(values).all():
            raise InvalidInput(path, values.ravel()[0], accepted)
        return float(values.mean())


def _emitters(field: _Fields, shape: tuple[int, int]) -> NDArray[np.int64]:
    """The element that emits in each emission, (n_tx,)."""
    apodization = np.abs(field.numbers("tx_apodizations", shape, "1"))
    active = apodization > SILENT * np.maximum(apodization.max(axis=1, keepdims=True), SILENT)
    count = active.sum(axis=1)
    if (count != 1).any():
        k = int(np.flatnonzero(count != 1)[0])
        given = f"{count[k]} elements that emit in emission {k}"
        accepted = "one emitting element for each emission (synthetic aperture); plane waves, focused and "
        raise InvalidInput(
            field.path("tx_apodizations"), given, f"{accepted}diverging beams are not tomography"
        )
    return np.asarray(np.argmax(apodization, axis=1), dtype=np.int64)


def _in_plane(position: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n_el, 2) positions of an array in a plane of two axes, else (n_el, 3)."""
    width = np.ptp(position, axis=0)
    flat = width <= FLAT * width.max()
    return position[:, ~flat] if flat.sum() == 1 else position


READER = ScanReader(
    title="zea and OpenH-RF (HDF5)",
    about="`ScanSpec` and `DataSpec` in `zea/data/spec.py` of github.com/tue-bmd/zea; the groups are at the "
    "top or in `tracks/track_0`. Accepted are synthetic-aperture scans: one element emits at a time, one "
    "frame of radio-frequency data. An array in a plane becomes a 2-D scan. Maps of the true speed are not "
    "read.",
    variables=(
        Variable("data/raw_data", "(1, n_tx, n_ax, n_el, 1) numbers", "any", "traces"),
        Variable(
            "scan/probe_geometry or probe/probe_geometry", "(n_el, 3)", "m", "positions of the elements"
        ),
        Variable("scan/sampling_frequency", "number", "Hz", "sampling rate"),
        Variable("scan/tx_apodizations", "(n_tx, n_el)", "1", "one element differs from 0 in each row"),
        Variable("scan/t0_delays", "(n_tx, n_el)", "s", "delay of the emission"),
        Variable(
            "scan/initial_times",
            "(n_tx,)",
            "s",
            "time of the first sample; less the delay, the same for every emission",
        ),
        Variable("scan/center_frequency", "number or (n_tx,)", "Hz", "centre frequency", "no"),
        Variable("scan/sound_speed", "number", "m/s", "speed in the coupling medium", "no"),
    ),
    detect=_detect,
    read=_read,
)

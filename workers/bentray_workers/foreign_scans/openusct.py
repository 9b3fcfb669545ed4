"""Scans of openUSCT: HDF5 with ``geometry/element_pos`` and ``acquisition/data``.

Source:
    ``software/schema/README.md`` of github.com/Jerome-Graves/openUSCT, format version 1.0.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput

from .arrays import StreamedScan, Traces
from .matlab import rows_of
from .open_scan import OpenScan, ScanReader, Variable

POSITION, DATA, EMITTERS = "geometry/element_pos", "acquisition/data", "acquisition/tx_elements"
DATA_SHAPE = "(n_tx, n_samples, n_rx) numbers"
MAJOR = "1."


def _detect(scan: OpenScan) -> bool:
    return scan.has(POSITION, DATA)


def _read(scan: OpenScan) -> StreamedScan:
    assert scan.hdf5 is not None
    reader = scan.hdf5
    version = reader.text("", "format_version")
    if version is not None and not version.startswith(MAJOR):
        raise InvalidInput("@format_version", repr(version), "version 1 of openUSCT")
    data = reader.checked(DATA, "iuf", DATA_SHAPE)
    assert data is not None
    if data.ndim != 3 or 0 in data.shape:
        raise InvalidInput(DATA, f"shape {data.shape}", DATA_SHAPE)
    emissions, samples, receivers = data.shape
    position = reader.array(POSITION, "f", "(N, 2 or 3) numbers in m", 3 * receivers)
    if position is None or position.ndim != 2 or len(position) != receivers:
        given = "nothing" if position is None else f"shape {position.shape}"
        raise InvalidInput(POSITION, given, f"({receivers}, 2 or 3), as many as receivers in {DATA}")
    count = reader.number("geometry", "n_elements", "elements")
    if count not in (None, receivers):
        given = f"{count:g}, with {receivers} elements in {POSITION}"
        raise InvalidInput("geometry@n_elements", given, f"{receivers}, or no attribute")
    emitters = reader.array(EMITTERS, "iu", "(n_tx,) integers", emissions)
    if emitters is not None and emitters.shape != (emissions,):
        raise InvalidInput(EMITTERS, f"shape {emitters.shape}", f"({emissions},), as of {DATA}")
    rate = reader.number("acquisition", "sample_rate_hz", "Hz")
    if rate is None:
        raise InvalidInput("acquisition@sample_rate_hz", "nothing", "a rate in Hz")

    def traces() -> Iterator[NDArray[Any]]:
        for emission in rows_of(data, DATA):
            yield np.ascontiguousarray(emission.T)

    return StreamedScan(
        "openUSCT",
        {
            "geometry/element_position_m": position,
            "acquisition/tx": np.arange(emissions) if emitters is None else emitters,
            "acquisition/rx": np.arange(receivers),
            "acquisition/sampling_rate_hz": rate,
            "acquisition/center_frequency_hz": reader.number("acquisition", "tx_centre_freq_hz", "Hz")
            or reader.number("geometry", "centre_freq_hz", "Hz"),
            # That of the medium between the array and the object, with which openUSCT images are made.
            "water/sound_speed_mps": reader.number("acquisition", "nominal_speed_m_s", "m/s"),
            "geometry/radius_m": reader.number("geometry", "radius_m", "m"),
        },
        {"waveform/object": Traces((emissions, receivers, samples), data.dtype, traces)},
    )


READER = ScanReader(
    title="openUSCT (HDF5)",
    about="Schema 1.0 of `software/schema` in github.com/Jerome-Graves/openUSCT. One element emits at a "
    "time. Attributes are marked with @. The ground truth of a simulation is not read.",
    variables=(
        Variable("/geometry/element_pos", "(N, 2 or 3)", "m", "positions of the elements"),
        Variable("/acquisition/data", "(n_tx, n_samples, n_rx) numbers", "any", "traces; N is n_rx"),
        Variable("/acquisition @sample_rate_hz", "number", "Hz", "sampling rate"),
        Variable(
            "/acquisition/tx_elements",
            "(n_tx,) integers",
            "",
            "emitting elements, from 0; absent: the first n_tx",
            "no",
        ),
        Variable("/acquisition @tx_centre_freq_hz", "number", "Hz", "centre frequency", "no"),
        Variable("/acquisition @nominal_speed_m_s", "number", "m/s", "speed in the coupling medium", "no"),
        Variable("/geometry @n_elements", "number", "", "N, which is checked", "no"),
        Variable("/geometry @radius_m", "number", "m", "radius of the ring", "no"),
    ),
    detect=_detect,
    read=_read,
)

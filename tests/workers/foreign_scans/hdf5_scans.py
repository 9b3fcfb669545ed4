"""Small scans as zea and openUSCT write them, by their public descriptions."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from .scans import ELEMENTS, RATE_HZ, SAMPLES, T0_S, positions, traces

EMITTERS = (6, 1, 3)


def emitted() -> np.ndarray:
    """(emissions, receivers, samples), float32, as in the upload format."""
    return traces().transpose(2, 1, 0)[: len(EMITTERS)].astype(np.float32)


def zea_fields(**changes: Any) -> dict[str, Any]:
    """Fields by path; the schema is ``ScanSpec`` and ``DataSpec`` in zea/data/spec.py of tue-bmd/zea."""
    count = len(EMITTERS)
    apodization = np.zeros((count, ELEMENTS), np.float32)
    apodization[np.arange(count), EMITTERS] = 1.0
    fields = {
        "data/raw_data": emitted().transpose(0, 2, 1)[None, ..., None],
        "scan/probe_geometry": np.column_stack((positions(), np.zeros(ELEMENTS))).astype(np.float32),
        "scan/sampling_frequency": np.float32(RATE_HZ),
        "scan/center_frequency": np.float32(4e5),
        "scan/demodulation_frequency": np.float32(0.0),
        "scan/initial_times": np.full(count, T0_S, np.float32),
        "scan/t0_delays": np.zeros((count, ELEMENTS), np.float32),
        "scan/tx_apodizations": apodization,
        "scan/focus_distances": np.zeros(count, np.float32),
        "scan/transmit_origins": np.zeros((count, 3), np.float32),
        "scan/polar_angles": np.zeros(count, np.float32),
        "scan/sound_speed": np.float32(1490.0),
    }
    return {path: value for path, value in (fields | changes).items() if value is not None}


def openusct_fields(**changes: Any) -> dict[str, Any]:
    """Fields by path, attributes with @; the schema is software/schema/README.md of openUSCT, version 1.0."""
    fields = {
        "@format_version": "1.0",
        "@description": "a small ring",
        "geometry@n_elements": ELEMENTS,
        "geometry@radius_m": 0.1,
        "geometry@array_type": "ring",
        "geometry/element_pos": positions(),
        "acquisition@sample_rate_hz": RATE_HZ,
        "acquisition@tx_centre_freq_hz": 4e5,
        "acquisition@nominal_speed_m_s": 1490.0,
        "acquisition/data": emitted().transpose(0, 2, 1),
        "acquisition/tx_wavelet": np.zeros(SAMPLES),
        "acquisition/tx_elements": np.array(EMITTERS),
        "ground_truth/c": np.full((4, 4), 1500.0),
    }
    return {path: value for path, value in (fields | changes).items() if value is not None}


def write_fields(path: Path, fields: dict[str, Any]) -> Path:
    """Write arrays, compressed with gzip as both programs do, and attributes."""
    with h5py.File(path, "w") as file:
        for place, value in fields.items():
            group, _, attribute = place.partition("@")
            if attribute:
                file.require_group(group or "/").attrs[attribute] = value
            else:
                file.create_dataset(place, data=value, compression="gzip" if np.ndim(value) else None)
    return path

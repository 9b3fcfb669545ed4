"""Small scans as other programs write them."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_workers.foreign_scans import convert_dataset

ELEMENTS = 8
SAMPLES = 20
RATE_HZ = 2.0e6
T0_S = -1.0e-6


def positions() -> np.ndarray:
    """(N, 2), m."""
    angle = 2.0 * np.pi * np.arange(ELEMENTS) / ELEMENTS
    return 0.1 * np.column_stack((np.cos(angle), np.sin(angle)))


def delta_tof() -> np.ndarray:
    """(N, N), s: the upper triangle, NaN elsewhere, and not symmetric."""
    values = 1e-7 * np.arange(ELEMENTS**2, dtype=float).reshape(ELEMENTS, ELEMENTS)
    return np.where(np.triu(np.ones_like(values), 1) > 0, values, np.nan)


def traces() -> np.ndarray:
    """(Nt, Nrx, Ntx) as MATLAB has them, every sample different."""
    return np.random.default_rng(0).standard_normal((SAMPLES, ELEMENTS, ELEMENTS))


def travel_times() -> dict[str, np.ndarray]:
    """Travel times in the form of open-UST."""
    return {"delta_tof": delta_tof(), "element_positions": positions()}


def waveforms() -> dict[str, np.ndarray]:
    """Waveforms in the form of full waveform inversions in MATLAB."""
    time = T0_S + np.arange(SAMPLES) / RATE_HZ
    return {"time": time[None], "transducerPositionsXY": positions().T, "full_dataset": traces()}


def write_matlab73(path: Path, variables: dict[str, np.ndarray], *, header: bool = True) -> None:
    """Write like MATLAB: axes reversed, a block of 512 bytes in front."""
    with h5py.File(path, "w", userblock_size=512 if header else 0) as file:
        for name, array in variables.items():
            made = file.create_dataset(name, data=np.asarray(array).T, compression="gzip")
            made.attrs["MATLAB_class"] = np.bytes_("double")
    if header:
        with path.open("r+b") as raw:
            raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def refused(source: Path, match: str = ": found ") -> InvalidInput:
    """The refusal of a scan, which leaves no file."""
    target = source.with_name("canonical.h5")
    with pytest.raises(InvalidInput, match=match) as caught:
        convert_dataset(source, target)
    assert not target.exists()
    return caught.value

"""A volume in other file formats, made once and kept."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import numpy as np

from bentray_workers.reconstruction_file import read_reconstruction


def speed_as_npy(volume: Path, target: Path) -> Path:
    """The speed of a reconstruction file, (x, y[, z]) m/s, as a NumPy file; made when first asked for."""
    if target.exists():
        return target
    speed = read_reconstruction(volume).speed
    # A name of its own for each writer: two requests may make the same file at the same time.
    handle, name = tempfile.mkstemp(dir=target.parent, suffix=".partial")
    partial = Path(name)
    try:
        with os.fdopen(handle, "wb") as file:
            np.save(file, np.ascontiguousarray(speed), allow_pickle=False)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(target)
    finally:
        partial.unlink(missing_ok=True)
    return target

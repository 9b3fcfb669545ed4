"""A volume in other file formats, made once and kept."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bentray_workers.atomic import replacing
from bentray_workers.reconstruction_file import read_reconstruction


def speed_as_npy(volume: Path, target: Path) -> Path:
    """The speed of a reconstruction file, (x, y[, z]) m/s, as a NumPy file; made when first asked for."""
    if target.exists():
        return target
    speed = read_reconstruction(volume).speed
    with replacing(target) as partial, partial.open("wb") as file:
        np.save(file, np.ascontiguousarray(speed), allow_pickle=False)
    return target

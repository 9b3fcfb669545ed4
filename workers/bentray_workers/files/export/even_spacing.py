"""Rejection of unevenly spaced slices by formats that store one spacing per axis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bentray_kernels.errors import InvalidInput


def check_even_spacing(spacing_m: Sequence[float], name: str) -> None:
    """Raise InvalidInput for slices with uneven spacing (not finite, m), which the format cannot store."""
    if not np.isfinite(spacing_m).all():
        given = f"uneven slices (spacing {tuple(float(step) for step in spacing_m)} m)"
        raise InvalidInput("volume", given, f"even spacing for {name}; hdf5 holds any")

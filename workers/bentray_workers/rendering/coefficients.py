"""Coefficients of a filtered volume, for programs that cast rays through it themselves."""

import io
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bentray_kernels.errors import InvalidInput

from .refraction_view import RefractionView
from .scene_cache import filtered_at

# 64 MiB in float32, which a graphics card holds.
MAX_NODES = 2**24


def check_nodes(shape: Sequence[int]) -> None:
    """Reject a volume with too many nodes.

    Raises:
        InvalidInput: naming ``volume``.
    """
    if math.prod(shape) > MAX_NODES:
        raise InvalidInput("volume", f"shape {tuple(shape)}", f"at most {MAX_NODES} nodes")


def coefficients_npy(path: Path, view: RefractionView) -> bytes:
    """Task: the coefficients of a volume or reconstruction file behind the filter of a view, as a NumPy file.

    Args:
        path: of the file.
        view: ``filter`` and ``smoothing`` are used.

    Returns:
        float32 (x, y, z), C order, with the border of the filter: see ``splines.Spline.coefficients``.

    Raises:
        InvalidInput: from the file, and for a volume that is too large.
    """
    buffer = io.BytesIO()
    np.save(buffer, filtered_at(path, view).spline.coefficients.astype(np.float32), allow_pickle=False)
    return buffer.getvalue()

"""Histogram of a quantity of a volume, and the surface that a picture shows by default."""

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.ranges import Range

from ..files.quantities import QUANTITIES
from ..files.reconstruction import read_reconstruction
from ..files.volume import read_volume
from .refraction_view import check_even
from .scene_cache import default_surface

BINS = Range(2, 1024)
DEFAULT_BINS = 256

# The quantities that are rendered.
RENDERED = ("speed", "value")


def volume_histogram(path: Path, quantity: str, bins: int) -> dict[str, Any]:
    """Task: the histogram of all nodes of a quantity.

    Args:
        path: of a volume or reconstruction file.
        quantity: ``value`` of a volume; ``speed``, ``coverage``, ``attenuation``, ``recovery``,
            ``uncertainty`` or ``reflection`` of a reconstruction.
        bins: of equal width between least and greatest value.

    Returns:
        ``counts`` and ``edges`` as by ``numpy.histogram``, ``minimum``, ``maximum``, ``mean`` and
        ``deviation`` (standard deviation) in ``unit``; ``iso``, ``smoothing`` and ``up`` of a picture of the
        volume without these parameters, None where it cannot be rendered.

    Raises:
        InvalidInput: naming ``bins`` or ``quantity``, and from the file.
    """
    BINS.check("bins", bins)
    values, spacing_m = _read(path, quantity)
    counts, edges = np.histogram(values, bins)
    unit = "" if quantity == "value" else QUANTITIES[quantity].unit
    iso = smoothing = up = None
    if quantity in RENDERED:
        with suppress(InvalidInput):
            check_even(values.shape, spacing_m)
            iso, smoothing, up = default_surface(path)
    return {
        "quantity": quantity,
        "unit": "" if unit == "1" else unit,
        "counts": counts.tolist(),
        "edges": edges.tolist(),
        "minimum": float(values.min()),
        "maximum": float(values.max()),
        "mean": float(values.mean(dtype=np.float64)),
        "deviation": float(values.std(dtype=np.float64)),
        "iso": iso,
        "smoothing": smoothing,
        "up": up,
    }


def _read(path: Path, quantity: str) -> tuple[NDArray[Any], tuple[float, ...]]:
    """Values and spacing of a quantity."""
    if quantity == "value":
        volume = read_volume(path)
        return volume.values, volume.spacing_m
    result = read_reconstruction(path)
    image = result.image(quantity)
    if image is None:
        held = [name for name in QUANTITIES if getattr(result, name) is not None]
        raise InvalidInput("quantity", repr(quantity), f"one of {', '.join(held)}: this file has no other")
    return image.values, image.spacing_m

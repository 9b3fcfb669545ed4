"""Fields of a scan in foreign arrays: numbers, indices, water and truth."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.acquisition import Truth, speed_from_temperature
from bentray_kernels.errors import InvalidInput

from ..files.dataset.read import trace_type
from .arrays import Arrays, read_small

# Assumed temperature of water if the file has none; noted in the dataset.
USUAL_C = 20.0


def water(arrays: Arrays) -> tuple[float, float | None, bool]:
    """Speed and temperature of water, and whether they are assumed."""
    speed, temperature = (number(arrays, f"water/{name}") for name in ("sound_speed_mps", "temperature_c"))
    if speed is not None:
        return speed, temperature, False
    if temperature is not None:
        return speed_from_temperature(temperature), temperature, False
    return speed_from_temperature(USUAL_C), USUAL_C, True


def truth(arrays: Arrays) -> Truth | None:
    """The truth; only with its group, since its speed has the same name as that of water."""
    speed = read_small(arrays, "truth/sound_speed_mps", "numbers in m/s")
    if speed is None:
        return None
    spacing, origin = (
        required(arrays, f"truth/{name}", "a number in m for each axis").ravel()
        for name in ("spacing_m", "origin_m")
    )
    losses = read_small(arrays, "truth/attenuation_np_m", "numbers in Np/m")
    return Truth(
        np.asarray(speed, dtype=np.float64),
        tuple(float(v) for v in (np.repeat(spacing, speed.ndim) if spacing.size == 1 else spacing)),
        tuple(float(v) for v in origin),
        None if losses is None else np.asarray(losses, dtype=np.float64),
        "x,y" if speed.ndim == 2 else "x,y,z",
    )


def name_in_file(arrays: Arrays, path: str) -> str:
    """The name of an array of the upload format in this file: with or without its group."""
    leaf = path.rpartition("/")[2]
    return path if path in arrays.names() or leaf not in arrays.names() else leaf


def required(arrays: Arrays, name: str, accepted: str) -> NDArray[np.float64]:
    """A small array of numbers that must be present."""
    array = read_small(arrays, name, accepted)
    if array is None:
        raise InvalidInput(name, "nothing", accepted)
    return np.asarray(array, dtype=np.float64)


def declared(arrays: Arrays, name: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type of an array that must be present."""
    declaration = arrays.declared(name)
    if declaration is None:
        raise InvalidInput(name, "nothing", "an array")
    return declaration


def indices(arrays: Arrays, name: str) -> NDArray[np.int64]:
    """Indices of elements."""
    accepted = "(n,) integers that count elements from 0"
    array = read_small(arrays, name, accepted)
    if array is None or array.dtype.kind not in "iu":
        raise InvalidInput(name, "nothing" if array is None else f"{array.dtype}", accepted)
    if array.dtype.kind == "u" and array.size and array.max() > np.iinfo(np.int64).max:
        raise InvalidInput(name, array.max(), accepted)
    return np.ascontiguousarray(array, dtype=np.int64)


def number(arrays: Arrays, path: str) -> float | None:
    """A finite number, or None."""
    name = name_in_file(arrays, path)
    declaration = arrays.declared(name)
    # Checked before reading, since it may be large.
    if declaration is not None and math.prod(declaration[0]) != 1:
        raise InvalidInput(name, f"shape {declaration[0]}", "one finite number")
    array = read_small(arrays, name, "one number")
    if array is None:
        return None
    if not np.isfinite(array).all():
        raise InvalidInput(name, array.ravel()[0], "one finite number")
    return float(array.ravel()[0])


def placeholder(arrays: Arrays, name: str) -> NDArray[Any]:
    """An array of the shape and type of the traces that takes no memory."""
    shape, dtype = declared(arrays, name)
    if len(shape) != 3:
        raise InvalidInput(name, f"shape {shape}", "(ntx, nrx, nt)")
    return np.broadcast_to(np.zeros((), trace_type(dtype)), shape)

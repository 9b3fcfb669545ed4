"""Registration: error of an image whose truth is shifted and possibly transposed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates
from scipy.optimize import minimize

from bentray_kernels.acquisition import Truth
from bentray_kernels.tomography import Reconstruction

from ..shared._image_error import ErrorOn, ImageError

# Shifts to begin with, and as far as one may go, m.
SHIFTS_M = np.arange(-4e-3, 4.1e-3, 1e-3)


@dataclass(frozen=True)
class Registered:
    """The least error that a shift gives.

    Attributes:
        rms_mps: m/s.
        shift_m: of the truth, m.
        transposed: whether the truth's axes were exchanged.
    """

    rms_mps: float
    shift_m: tuple[float, float]
    transposed: bool


def registered(image: Reconstruction, truth: Truth, radius_m: float) -> Registered:
    """The error within a radius of the array's centre, at the best shift of the truth, without rotation.

    Args:
        image: one slice.
        truth: on its own grid.
        radius_m: m.
    """
    inside, nodes = _nodes_within(image, radius_m)
    speed = image.speed[inside]
    fits = []
    for transposed in (False, True):

        def error(shift: NDArray[np.float64], transposed: bool = transposed) -> float:
            true = _read(truth, nodes, shift, transposed)
            return float(np.sqrt(np.mean((true - speed) ** 2)))

        first = min(((a, b) for a in SHIFTS_M for b in SHIFTS_M), key=lambda s: error(np.array(s)))
        simplex = np.array([first, (first[0] + 5e-4, first[1]), (first[0], first[1] + 5e-4)])
        best = minimize(
            error,
            first,
            method="Nelder-Mead",
            options={"xatol": 1e-5, "fatol": 1e-3, "initial_simplex": simplex},
        )
        fits.append(Registered(float(best.fun), (float(best.x[0]), float(best.x[1])), transposed))
    return min(fits, key=lambda fit: fit.rms_mps)


def registered_error(fit: Registered, truth: Truth, radius_m: float) -> ErrorOn:
    """Root mean square error, m/s, at a shift of the truth that was found before."""

    def error_on(image: Reconstruction) -> ImageError:
        inside, nodes = _nodes_within(image, radius_m)
        true = np.full(image.speed.shape, np.nan)
        true[inside] = _read(truth, nodes, np.array(fit.shift_m), fit.transposed)
        return ImageError(true, inside)

    return error_on


def _nodes_within(image: Reconstruction, radius_m: float) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Nodes within a radius of the array's centre, and their places, (2, nodes), m."""
    axes = [
        low + image.spacing_m[0] * np.arange(n)
        for low, n in zip(image.origin_m, image.speed.shape, strict=True)
    ]
    x, y = np.meshgrid(*axes, indexing="ij")
    inside = np.hypot(x, y) <= radius_m
    return inside, np.stack([x[inside], y[inside]])


def _read(
    truth: Truth, nodes: NDArray[np.float64], shift: NDArray[np.float64], transposed: bool
) -> NDArray[np.float64]:
    """The shifted truth at places, m/s."""
    at = (nodes - np.reshape(shift, (2, 1)) - np.reshape(truth.origin_m[:2], (2, 1))) / np.reshape(
        truth.spacing_m[:2], (2, 1)
    )
    drawn = truth.sound_speed_mps.T if transposed else truth.sound_speed_mps
    return np.asarray(map_coordinates(drawn, at, order=1, mode="nearest"))

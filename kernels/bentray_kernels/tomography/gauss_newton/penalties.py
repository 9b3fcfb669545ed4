"""Differential operators of the penalties of an image, and their adjoints."""

from typing import Literal

import numpy as np

from ...arrays import Floats

Penalty = Literal["total-variation", "laplacian", "tikhonov"]
PENALTIES: tuple[Penalty, ...] = ("total-variation", "laplacian", "tikhonov")


def gradient(image: Floats) -> Floats:
    """Forward differences along every axis, (ndim, *shape); 0 beyond the last node."""
    slope: Floats = np.zeros((image.ndim, *image.shape))
    for axis in range(image.ndim):
        np.subtract(_upper(image, axis), _lower(image, axis), out=_lower(slope[axis], axis))
    return slope


def adjoint(slope: Floats) -> Floats:
    """The adjoint of ``gradient``: shape from (ndim, *shape)."""
    image: Floats = np.zeros(slope.shape[1:])
    for axis, along in enumerate(slope):
        difference = _lower(along, axis)
        upper, lower = _upper(image, axis), _lower(image, axis)
        upper += difference
        lower -= difference
    return image


def laplacian(image: Floats) -> Floats:
    """Second differences summed over the axes, without flux across the boundary; self-adjoint."""
    return -adjoint(gradient(image))


def roughness(shape: tuple[int, ...]) -> Floats:
    """Eigenvalues of minus ``laplacian``, squared wavenumbers, 1/node²; of the type 2 cosine transform."""
    angles = np.ix_(*(np.pi * np.arange(nodes) / nodes for nodes in shape))
    return np.asarray(sum(2.0 - 2.0 * np.cos(angle) for angle in angles))


def length(slope: Floats) -> Floats:
    """Magnitude of each gradient: shape from (ndim, *shape)."""
    return np.asarray(np.sqrt((slope**2).sum(axis=0)))


def shrink(slope: Floats, by: Floats | float) -> Floats:
    """Soft thresholding: each gradient shortened by ``by``, a number or one for each, to no less than 0."""
    return np.asarray(slope * np.maximum(1.0 - by / np.maximum(length(slope), 1e-300), 0.0))


def _upper(image: Floats, axis: int) -> Floats:
    return image[(slice(None),) * axis + (slice(1, None),)]


def _lower(image: Floats, axis: int) -> Floats:
    return image[(slice(None),) * axis + (slice(None, -1),)]

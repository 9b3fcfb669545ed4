"""Spline interpolation on an OpenCL device: value and gradient at many points in one launch."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats
from ..opencl import OpenCLFallbackWarning, Session, session_or_warning
from ..opencl.session import set_arguments
from .spline import Spline

# Points of a work-group.
GROUP = 64

# Points that are compared with the CPU in the self-test.
TRIED = 100

# Tolerance relative to the largest coefficient, by the type of the coefficients.
TOLERANCES = {"float64": 1e-12, "float32": 1e-5}


class OpenCLSpline:
    """A ``Spline`` with its coefficients on a device, and the same results.

    The sums are in the type of the coefficients: to 1e-12 in float64 and 1e-5 in float32 of the largest one.

    Args:
        spline: any filter, 1-D to 3-D.
        session: the device.
    """

    def __init__(self, spline: Spline, session: Session) -> None:
        self.spline = spline
        self.session = session
        with session.lock:
            self._coefficients = session.upload(spline.coefficients)
            self._tables = session.upload(spline.stencil.weights)

    def value(self, points: ArrayLike) -> Floats:
        """As ``Spline.value``."""
        return self.value_and_gradient(points)[0]

    def gradient(self, points: ArrayLike) -> Floats:
        """As ``Spline.gradient``."""
        return self.value_and_gradient(points)[1]

    def value_and_gradient(self, points: ArrayLike) -> tuple[Floats, Floats]:
        """As ``Spline.value_and_gradient``."""
        places = self.spline.places(points)
        values, gradients = np.empty(len(places)), np.empty(places.shape)
        # A point, its value and its gradient.
        at_once = max(1, self.session.doubles_at_once() // (2 * places.shape[1] + 1))
        for start in range(0, len(places), at_once):
            part = slice(start, start + at_once)
            values[part], gradients[part] = self._read(places[part])
        return values, gradients

    def _read(self, places: Floats) -> tuple[Any, Any]:
        spline, session = self.spline, self.session
        real = spline.coefficients.dtype
        dims, taps = len(spline.shape), spline.filter.taps
        name = "float" if real == np.float32 else "double"
        sizes = f"DIMS={dims}", f"TAPS={taps}", f"WIDTH={spline.stencil.weights.shape[-1]}"
        kernel = session.kernel(("splines",), "sample", f"REAL={name}", *sizes)
        values, gradients = np.empty(len(places), real), np.empty(places.shape, real)
        nodes = (1,) * (3 - dims) + spline.shape
        border = spline.coefficients.shape[0] - spline.shape[0]
        with session.lock:
            # Setting an argument does not keep its buffer alive: the names do.
            at = session.upload(places)
            read, turned = session.reserve(values.nbytes), session.reserve(gradients.nbytes)
            sizes_there = *map(np.int32, (*nodes, border)), np.uint32(len(places))
            shift = np.float64(spline.stencil.shift)
            set_arguments(kernel, self._coefficients, self._tables, shift, *sizes_there, at, read, turned)
            session.launch(kernel, (-(-len(places) // GROUP) * GROUP,), (GROUP,))
            session.download(values, read)
            session.download(gradients, turned)
        return values, gradients


def on_the_device(spline: Spline) -> Spline | OpenCLSpline:
    """The spline on the chosen OpenCL device; or itself, where no device passes its self-test.

    Args:
        spline: any filter.

    Raises:
        InvalidInput: where ``BENTRAY_OPENCL_DEVICE`` does not match one device.

    Warns:
        OpenCLFallbackWarning: where no device passes its self-test, or evaluates this spline wrong.
    """
    session = session_or_warning(instead="Spline")
    if session is None:
        return spline
    there = OpenCLSpline(spline, session)
    fault = fault_of(there)
    if fault:
        message = f"{session.handle.name} reads {spline.filter.name} wrong, Spline takes over: {fault}"
        warnings.warn(OpenCLFallbackWarning(message), stacklevel=2)
        return spline
    return there


def fault_of(there: OpenCLSpline) -> str:
    """Difference between device and CPU at points on and off the grid, as a message; empty if correct."""
    spline = there.spline
    nodes = np.array(spline.shape)
    points = np.random.default_rng(0).uniform(-0.5, 1.5, (TRIED, len(nodes))) * nodes
    far = TOLERANCES[spline.coefficients.dtype.name] * max(1e-300, float(np.abs(spline.coefficients).max()))
    pairs = zip(there.value_and_gradient(points), spline.value_and_gradient(points), strict=True)
    off = max(float(np.abs(result - expected).max()) for result, expected in pairs)
    return "" if off <= far else f"off by {off:.3g} where {far:.3g} is allowed"

"""One problem that an OpenCL device and compiled code both solve."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats


@dataclass(frozen=True)
class Engine:
    """A problem, solved here and on the device.

    Attributes:
        engine: one of ``opencl.device_benchmark.ENGINES``, or another word where no benchmark decides.
        name: what is computed, and its size.
        here: solves it with compiled code.
        there: solves it on the device; None where the device computes this engine wrong.
        size: work of one solve, in ``unit``.
        unit: what is counted, for example node updates.
        least_bytes: that one solve reads and writes at the least, each array once a pass; None where memory
            does not bound it.
        error: largest difference of the two results, in ``error_unit``.
        bound: of that difference.
        threads: of compiled code.
    """

    engine: str
    name: str
    here: Callable[[], Floats]
    there: Callable[[], Floats] | None
    size: float
    unit: str
    least_bytes: float | None
    error: Callable[[Floats, Floats], float]
    error_unit: str
    bound: float
    threads: int = 1


def relative(computed: Floats, expected: Floats) -> float:
    """Largest difference over the largest value."""
    return float(np.abs(computed - expected).max() / np.abs(expected).max())


def rms_difference(computed: Floats, expected: Floats) -> float:
    """Root of the mean squared difference."""
    return float(np.sqrt(((computed - expected) ** 2).mean()))


def odd_pixels(computed: Floats, expected: Floats) -> float:
    """Fraction of pixels that differ by more than one of 255."""
    return float((np.abs(computed - expected).max(axis=2) > 1.0).mean())

"""One problem that an OpenCL device and compiled code both solve."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..arrays import Floats


class Difference(NamedTuple):
    """A measure of the difference between two results, and its unit."""

    of: Callable[[Floats, Floats], float]
    unit: str


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
        error: measure of the difference of the two results.
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
    error: Difference
    bound: float
    threads: int = 1


# Largest difference over the largest value.
RELATIVE = Difference(
    lambda one, other: float(np.abs(one - other).max() / np.abs(other).max()), "of the largest"
)

# Root of the mean squared difference of two images of speed.
RMS = Difference(lambda one, other: float(np.sqrt(((one - other) ** 2).mean())), "m/s rms")

# Fraction of pixels that differ by more than one of 255.
ODD_PIXELS = Difference(
    lambda one, other: float((np.abs(one - other).max(axis=2) > 1.0).mean()), "of the pixels"
)

"""Pressure traces of one emitter by OpenCL, or by the CPU where no device passes its self-test."""

from __future__ import annotations

import numpy as np

from ..arrays import Floats
from .emissions import Emissions, simulate_emissions
from .medium import Medium


def simulate_opencl(medium: Medium, emitter: Floats, receivers: Floats, wavelet: Floats) -> Floats:
    """As ``simulate``, from the same stencil, factors and weights; equal to it except for rounding.

    Raises:
        InvalidInput: as ``simulate``, and where ``BENTRAY_OPENCL_DEVICE`` does not
            match one device.

    Warns:
        OpenCLFallbackWarning: once, where no device passes its self-test and compiled code computes instead.
    """
    emissions = Emissions(np.atleast_2d(emitter), receivers, [np.arange(len(receivers))], wavelet)
    (traces,) = simulate_emissions(medium, emissions, engine="opencl")
    return traces

"""Scans by a ring whose every element sends and receives."""

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.ring_scan import Ring


def ring_scan(elements, radius_m, delta_tof_s=None, water_mps=1500.0, **fields):
    """Those of water unless times are given, (elements, elements), s; other fields as in ``Dataset``."""
    everyone = np.arange(elements)
    delta = np.zeros((elements, elements)) if delta_tof_s is None else delta_tof_s
    position = Ring(elements, radius_m).positions()
    return Dataset(position, everyone, everyone, water_mps, delta_tof_s=delta, **fields)

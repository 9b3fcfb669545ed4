"""Scans of the two-dimensional breast phantom of Table 6 by a ring: exact times, computed once a process."""

from functools import cache

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.ring_scan import Ring, TravelTimeScan
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6


@cache
def table6_scan(elements, nodes, radius_m=0.09, water_mps=1375.0, *, attenuation=False):
    """A scan in which every element sends and receives; its arrays cannot be written.

    Args:
        elements: of the ring.
        nodes: of the side of the phantom that is simulated.
        radius_m: of the ring.
        water_mps: speed of the water.
        attenuation: whether amplitudes are recorded too.
    """
    ring, everyone = Ring(elements, radius_m), np.arange(elements)
    simulation = TravelTimeScan(table6(water_mps), ring, TABLE6_SIDE_M, nodes=nodes)
    if attenuation:
        delta, ratio = simulation.medium(attenuation=True).arrivals(simulation.elements(), everyone)
        ratio.flags.writeable = False
    else:
        delta, ratio = simulation.delta_tof(everyone), None
    delta.flags.writeable = False
    return Dataset(ring.positions(), everyone, everyone, water_mps, delta_tof_s=delta, log_ratio_np=ratio)

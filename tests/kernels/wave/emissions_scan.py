"""A small medium with a few emissions, for tests of the engines."""

import numpy as np

from bentray_kernels.tomography.waveform import misfits
from bentray_kernels.wave.emissions import Emissions
from bentray_kernels.wave.medium import Medium

SPACING, STEP, STEPS, SHAPE = 1e-3, 2e-7, 180, (40, 45)
EMITTERS = np.array([[0.0123, 0.0201], [0.030, 0.0117], [0.0087, 0.0333], [0.0205, 0.0205], [0.0301, 0.0311]])
# The first two are so near that their taps meet.
RECEIVERS = np.array([[0.0301, 0.0311], [0.0311, 0.0303], [0.0202, 0.0352], [0.031, 0.012], [0.007, 0.008]])
VALID = [np.array(some) for some in ([0, 1, 2, 3, 4], [0, 1, 4], [3], [1, 2, 3], [4, 2])]
TIME = np.arange(STEPS) * STEP
WAVELET = 3e4 * np.exp(-(((TIME - 6e-6) * 2e5) ** 2)) * np.sin(2.0 * np.pi * 2e5 * (TIME - 6e-6))
EMISSIONS = Emissions(EMITTERS, RECEIVERS, VALID, WAVELET)


def medium(dtype=np.float32, seed=0, by=None):
    """A random medium with loss; ``by`` changes its speed or attenuation."""
    speed = 1500.0 + 40.0 * np.random.default_rng(seed).standard_normal(SHAPE)
    absorbed = np.random.default_rng(seed + 1).uniform(30.0, 60.0, SHAPE)
    if by is not None:
        unknown, way = by
        if unknown == "speed":
            # The gradient by speed holds the damping in time, not over distance.
            absorbed *= speed / (speed + way)
            speed = speed + way
        else:
            absorbed = absorbed + way
    return Medium.from_speed(speed, SPACING, STEP, attenuation=absorbed, edge_nodes=8, dtype=dtype)


def change(seed):
    """A change of the image that leaves its rim, which the edges continue, as it is."""
    way = np.random.default_rng(seed).standard_normal(SHAPE)
    way[[0, -1]] = way[:, [0, -1]] = 0.0
    return way


def windows(k):
    """Weight of each sample of an emission's traces."""
    arrival = np.linalg.norm(RECEIVERS[VALID[k]] - EMITTERS[k], axis=1) / 1500.0 + 6e-6
    return misfits.arrival_window(arrival, TIME, 8e-6, 10e-6)


def compare(recorded):
    """The misfit of each emission's traces from recorded ones."""

    def misfit(k, traces):
        return misfits.correlation(traces, recorded[k], windows(k))

    return misfit

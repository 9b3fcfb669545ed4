"""Small media with a few emissions, in a plane and in space, for tests of the engines."""

from typing import NamedTuple

import numpy as np

from bentray_kernels.tomography.waveform import misfits
from bentray_kernels.wave.emissions import Emissions
from bentray_kernels.wave.medium import Medium

SPACING, STEP, STEPS = 1e-3, 2e-7, 180
EMITTERS = np.array([[0.0123, 0.0201], [0.030, 0.0117], [0.0087, 0.0333], [0.0205, 0.0205], [0.0301, 0.0311]])
# The first two are so near that their taps meet.
RECEIVERS = np.array([[0.0301, 0.0311], [0.0311, 0.0303], [0.0202, 0.0352], [0.031, 0.012], [0.007, 0.008]])
VALID = [np.array(some) for some in ([0, 1, 2, 3, 4], [0, 1, 4], [3], [1, 2, 3], [4, 2])]


def pulse(time, late_s, band_hz):
    """A wavelet of 200 kHz."""
    return 3e4 * np.exp(-(((time - late_s) * band_hz) ** 2)) * np.sin(2.0 * np.pi * 2e5 * (time - late_s))


TIME = np.arange(STEPS) * STEP
WAVELET = pulse(TIME, 6e-6, 2e5)
EMISSIONS = Emissions(EMITTERS, RECEIVERS, VALID, WAVELET)


class Case(NamedTuple):
    """A grid and the emissions in it."""

    shape: tuple[int, ...]
    edge_nodes: int
    emissions: Emissions

    def medium(self, dtype=np.float32, seed=0, by=None):
        """A random medium with loss; ``by`` changes its speed or attenuation."""
        speed = 1500.0 + 40.0 * np.random.default_rng(seed).standard_normal(self.shape)
        absorbed = np.random.default_rng(seed + 1).uniform(30.0, 60.0, self.shape)
        if by is not None:
            unknown, way = by
            if unknown == "speed":
                # The gradient by speed holds the damping in time, not over distance.
                absorbed *= speed / (speed + way)
                speed = speed + way
            else:
                absorbed = absorbed + way
        return Medium.from_speed(
            speed, SPACING, STEP, attenuation=absorbed, edge_nodes=self.edge_nodes, dtype=dtype
        )


PLANE = Case((40, 45), 8, EMISSIONS)
SPACE = Case(
    (13, 15, 18),
    5,
    Emissions(
        np.array([[0.0031, 0.0042, 0.0123], [0.0088, 0.0101, 0.0049]]),
        np.array([[0.0093, 0.0112, 0.0031], [0.0021, 0.0131, 0.0155], [0.0102, 0.0113, 0.0037]]),
        [np.arange(3), np.array([1])],
        pulse(TIME[:70], 4e-6, 3e5),
    ),
)
medium = PLANE.medium


def change(seed, shape=PLANE.shape):
    """A change of the image that leaves its rim, which the edges continue, as it is."""
    way = np.random.default_rng(seed).standard_normal(shape)
    for axis in range(len(shape)):
        way.swapaxes(0, axis)[[0, -1]] = 0.0
    return way


def slope(value, small):
    """Derivative at 0 by differences of the fourth order."""
    near, far = ((value(k * small) - value(-k * small)) / (2.0 * k * small) for k in (1, 2))
    return (4.0 * near - far) / 3.0


def windows(k):
    """Weight of each sample of an emission's traces."""
    arrival = np.linalg.norm(RECEIVERS[VALID[k]] - EMITTERS[k], axis=1) / 1500.0 + 6e-6
    return misfits.arrival_window(arrival, TIME, 8e-6, 10e-6)


def compare(recorded):
    """The misfit of each emission's traces from recorded ones."""

    def misfit(k, traces):
        return misfits.correlation(traces, recorded[k], windows(k))

    return misfit

"""One emission through water or a breast by two simulators, and the differences of their traces."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bentray_kernels.phantoms import TABLE6_SIDE_M, table6
from bentray_kernels.tomography.waveform.trace_resampling import Clock, Water, resampler
from bentray_kernels.wave.medium import Medium
from bentray_kernels.wave.simulation import BAND_EDGE, simulate
from bentray_kernels.wave.stencil import longest_step, phase_error

WATER_MPS = 1500.0
CENTRE_HZ = 5e5

# The pulse is a sine under a Gaussian; at this many times its centre frequency it has 3 % of its height.
HIGHEST = 1.54
# Periods before the middle of the pulse, and recorded after the slowest arrival.
BEFORE, AFTER = 3.5, 12.0
# Time step, part of the longest stable one.
STEP = 0.5
# Of our time steps in one of k-Wave's: it is exact in the fastest of the media; in the others it has an error
# of time too, which this takes to a quarter.
THEIR_PARTS = 2
# Absorbing edge of ours, nodes: what it sends back is below what is measured here.
EDGE_NODES = 60
# Where a refinement's filter lets waves pass, times the centre frequency, and what it spreads, periods.
BAND, SPREAD = (0.4, 1.2), 8.0
# As in the benchmark of attenuation: at 500 kHz gland loses 5 Np/m.
LOSS_HZ = 5e6
# Radius of the ring, part of the side.
RING = 0.45

MEDIA = ("water", "breast", "breast with loss")


@dataclass(frozen=True)
class Shot:
    """An emission of a ring whose elements lie on nodes, which both simulators share.

    Attributes:
        name: of the medium, one of ``MEDIA``.
        points: nodes in the shortest wave of the pulse, in the slowest of the media.
        side_m: of the square, m.
        receivers: on the ring, the emitter left out.
    """

    name: str
    points: float
    side_m: float
    receivers: int = 31

    @cached_property
    def slowest(self) -> float:
        """m/s."""
        return WATER_MPS if self.name == "water" else table6(WATER_MPS).speed_range()[0]

    @cached_property
    def nodes(self) -> int:
        """Along a side."""
        return int(np.ceil(self.side_m * self.points * HIGHEST * CENTRE_HZ / self.slowest)) + 1

    @cached_property
    def spacing(self) -> float:
        """m."""
        return self.side_m / (self.nodes - 1)

    @cached_property
    def step(self) -> float:
        """Time step, s."""
        return STEP * longest_step(table6(WATER_MPS).speed_range()[1], self.spacing)

    @cached_property
    def time(self) -> np.ndarray:
        """Times of the samples, the middle of the pulse at 0, (nt,), s."""
        last = 2.0 * RING * self.side_m / self.slowest + AFTER / CENTRE_HZ
        return np.arange(-BEFORE / CENTRE_HZ, last, self.step)

    @cached_property
    def speed(self) -> np.ndarray:
        """(nodes, nodes), m/s."""
        if self.name == "water":
            return np.full((self.nodes, self.nodes), WATER_MPS)
        return table6(WATER_MPS).speed(self.nodes, TABLE6_SIDE_M)

    @cached_property
    def loss(self) -> np.ndarray | None:
        """(nodes, nodes), Np/m."""
        if self.name != "breast with loss":
            return None
        return CENTRE_HZ / LOSS_HZ * table6(WATER_MPS).attenuation(self.nodes, TABLE6_SIDE_M)

    @cached_property
    def medium(self) -> Medium:
        """For ours."""
        return Medium.from_speed(
            self.speed, self.spacing, self.step, attenuation=self.loss, edge_nodes=EDGE_NODES
        )

    @cached_property
    def ring(self) -> np.ndarray:
        """Nodes of the elements, the emitter first, (1 + receivers, 2)."""
        turn = 2.0 * np.pi * np.arange(self.receivers + 1) / (self.receivers + 1)
        position = RING * self.side_m * np.column_stack((np.cos(turn), np.sin(turn)))
        return np.rint((position + 0.5 * self.side_m) / self.spacing).astype(int)

    @cached_property
    def distance(self) -> np.ndarray:
        """To each receiver, (receivers,), m."""
        return self.spacing * np.linalg.norm(self.ring[1:] - self.ring[0], axis=1)

    @cached_property
    def spread(self) -> int:
        """Time steps."""
        return int(np.ceil(SPREAD / CENTRE_HZ / self.step))

    def ours(self) -> np.ndarray:
        """Traces, (receivers, nt)."""
        return self._simulated(pulse(self.time))

    def theirs(self, peer, steps: int = THEIR_PARTS) -> np.ndarray:
        """Traces of a peer, in ``steps`` of our time steps."""
        step = self.step / steps
        fine = self.time[0] + step * np.arange(self.time.size * steps)
        ring = self.ring
        return peer(self.speed, self.spacing, step, ring[0], ring[1:], pulse(fine), self.loss)[:, ::steps]

    def as_a_refinement(self, recorded: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Ours and recorded traces as a refinement compares them: filtered, our dispersion put into both.

        Both begin ``spread`` steps before the record, and end as long before its end, which the filter blurs.
        """
        clock = Clock(self.time[0] - self.spread * self.step, self.step, self.time.size)
        band = (BAND[0] * CENTRE_HZ, BAND[1] * CENTRE_HZ)
        matrix = resampler(self.time, clock, band, Water(WATER_MPS), self.spacing)
        return self._simulated(pulse(self.time) @ matrix), recorded @ matrix

    def _simulated(self, wavelet: np.ndarray) -> np.ndarray:
        ring = self.ring * self.spacing
        return simulate(self.medium, ring[0], ring[1:], wavelet)

    def budget(self, traces: np.ndarray) -> tuple[float, float]:
        """Phase error by ``phase_error``, for straight paths in the slowest of the media or the fastest.

        Space makes waves late and time makes them early, so that either may be the worse.

        Returns:
            relative rms difference of all traces; that of the arrival times at the centre frequency, s, in
            the median of the receivers.
        """
        both = [self._budget_at(float(speed), traces) for speed in (self.speed.min(), self.speed.max())]
        return max(pair[0] for pair in both), max(pair[1] for pair in both)

    def _budget_at(self, speed: float, traces: np.ndarray) -> tuple[float, float]:
        size = 2 * self.time.size
        frequency = np.fft.rfftfreq(size, self.step)
        spectrum = np.abs(np.fft.rfft(traces, size))
        error = np.zeros(spectrum.shape)
        for j in np.flatnonzero(spectrum.max(axis=0) >= 0.1 * BAND_EDGE * spectrum.max()):
            if j > 0:
                turn = np.pi * frequency[j] * self.lateness(speed, frequency[j])
                error[:, j] = 2.0 * np.sin(turn) * spectrum[:, j]
        return misfit(spectrum + error, spectrum), float(np.median(np.abs(self.lateness(speed))))

    def lateness(self, speed: float, frequency: float = CENTRE_HZ) -> np.ndarray:
        """Delay by ``phase_error`` of straight paths at one speed, (receivers,), s, > 0 where later."""
        across = self.ring[1:] - self.ring[0]
        courant = speed * self.step / self.spacing
        points = speed / (frequency * self.spacing)
        ahead = [phase_error(points, courant, float(np.arctan2(y, x))) for x, y in across]
        return -self.distance / speed * np.array(ahead)


def pulse(time: np.ndarray) -> np.ndarray:
    """Pulse of the emitter, the shape of ``time``, s."""
    late = time * CENTRE_HZ
    return np.exp(-((0.9 * late) ** 2)) * np.sin(2.0 * np.pi * late)


def misfit(traces: np.ndarray, expected: np.ndarray) -> float:
    """Relative rms difference over all traces; nothing is scaled or shifted to fit."""
    return float(np.sqrt(((traces - expected) ** 2).sum() / (expected**2).sum()))


def delays(traces: np.ndarray, expected: np.ndarray, step: float) -> np.ndarray:
    """How much later each trace comes, by the highest of their correlation, (receivers,), s."""
    fine, size = 8, 2 * traces.shape[1]
    cross = np.fft.rfft(traces, size) * np.fft.rfft(expected, size).conj()
    alike = np.fft.irfft(cross, fine * size, axis=1)
    top, rows = alike.argmax(axis=1), np.arange(len(traces))
    low, middle, high = (alike[rows, (top + k) % (fine * size)] for k in (-1, 0, 1))
    peak = top + 0.5 * (low - high) / (low - 2.0 * middle + high)
    peak -= fine * size * (peak > 0.5 * fine * size)
    return np.asarray(peak * step / fine)

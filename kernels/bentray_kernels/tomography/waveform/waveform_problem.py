"""The inverse problem of a scan in one band: elements on a grid, resampled traces, wavelet."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Flags, Floats, Ints
from ...wave.medium import Medium
from ...wave.simulation import simulate
from ...wave.stencil import OPTIMISED
from ...wave.time_blocks import Poll, no_poll
from .misfits import arrival_window
from .trace_resampling import Clock, Water
from .waveform_settings import Band


@dataclass(frozen=True)
class WaveProblem:
    """Data of the refinement in one band; made by ``waveform.preparation.prepare``.

    Attributes:
        band: the band.
        emitters: (ntx, 2), m, node 0 of the image at 0.
        receivers: (nrx, 2), m.
        region: (nodes, nodes), nodes that may change.
        origin: position of node 0 in the dataset's coordinates, m.
        clock: of the simulator.
        wavelet: (steps,), the source.
        water: fitted to the water shots.
        water_correlation: mean correlation of simulated with recorded water shots.
        weight: (ntx, nrx), 1 for the pairs that are used, else 0.
        arrival_s: (ntx, nrx), predicted arrival, s.
        traces: recorded object traces by emitter, (nrx, nt) each, of ``used`` and ``held``.
        gain: (ntx, nrx), pressure per count of each trace; for the attenuation normalised so that each water
            shot has its simulated amplitude.
        sampler: (nt, steps), see ``resampler``.
        used, held: emitters used for the image, and held-out ones.
        every: time steps between stored fields.
        poll: of its simulations, see ``time_blocks``.
    """

    band: Band
    emitters: Floats
    receivers: Floats
    region: Flags
    origin: tuple[float, float]
    clock: Clock
    wavelet: Floats
    water: Water
    water_correlation: float
    weight: Floats
    arrival_s: Floats
    traces: Mapping[int, NDArray[Any]]
    gain: Floats
    sampler: NDArray[np.float32]
    used: Ints
    held: Ints
    every: int
    poll: Poll = no_poll
    _observed: dict[int, tuple[NDArray[np.float32], NDArray[np.float32]]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def medium(self, speed: Floats, attenuation: Floats | None = None) -> Medium:
        """The medium of images on this grid."""
        return Medium.from_speed(
            speed, self.band.spacing_m, self.clock.step_s, attenuation=attenuation, order=OPTIMISED
        )

    def in_water(self, speed_mps: float) -> Medium:
        """Water of this speed on this grid."""
        return self.medium(np.full(self.region.shape, speed_mps))

    def simulated(self, medium: Medium, emitter: int, receivers: Ints, wavelet: Floats) -> Floats:
        """Traces of some receivers in a medium, (receivers, steps)."""
        where = self.emitters[emitter], self.receivers[receivers]
        return simulate(medium, *where, wavelet, poll=self.poll)

    def recorded(self, emitter: int, receivers: Ints) -> Floats:
        """Traces of some receivers, resampled to the simulator's time steps, (receivers, steps)."""
        sampled = self.traces[emitter][receivers] @ self.sampler
        return np.asarray(self.gain[emitter][receivers][:, None] * sampled, dtype=np.float64)

    def observed(
        self, emitter: int, reach_s: tuple[float, float]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """``recorded`` and ``window`` of all receivers for devices, (steps, receivers); kept in memory.

        The weight of receivers that are not used is 0.
        """
        if emitter not in self._observed:
            valid = self.valid_receivers(emitter)
            shape = (self.clock.steps, len(self.receivers))
            traces, weight = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
            traces[:, valid] = self.recorded(emitter, valid).T
            weight[:, valid] = self.window(emitter, valid, reach_s).T
            self._observed[emitter] = traces, weight
        return self._observed[emitter]

    def valid_receivers(self, emitter: int) -> Ints:
        """Receivers whose traces of an emitter are used."""
        return np.flatnonzero(self.weight[emitter] > 0.0)

    def until(self, emitter: int, receivers: Ints, reach_s: tuple[float, float]) -> Ints:
        """Samples of each trace that have a weight in ``window``, (receivers,)."""
        end = (self.arrival_s[emitter][receivers] + reach_s[1] - self.clock.begin_s) / self.clock.step_s
        return np.asarray(np.clip(np.ceil(end), 0, self.clock.steps), dtype=np.int64)

    def window(self, emitter: int, receivers: Ints, reach_s: tuple[float, float]) -> Floats:
        """Weight of each sample, (receivers, steps): a window around the arrival, tapered at the end."""
        times = self.clock.begin_s + self.clock.step_s * np.arange(self.clock.steps, dtype=np.float64)
        ending = np.clip((times[-1] - times) * 0.5 * self.band.high_hz, 0.0, 1.0)
        return np.asarray(arrival_window(self.arrival_s[emitter][receivers], times, *reach_s) * ending)

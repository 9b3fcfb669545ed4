"""Scans of a ring around objects in water, by k-Wave or by our simulator on a finer grid of another order."""

import math
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from bentray_kernels.acquisition import Dataset, Truth, Waveform
from bentray_kernels.arrays import Flags, Floats, Ints
from bentray_kernels.wave.medium import Medium
from bentray_kernels.wave.simulation import simulate
from bentray_kernels.wave.stencil import longest_step
from bentray_service.cli.output.terminal import Step

from ..waves._kwave_peer import Peer

# The pulse: its highest frequency in centre frequencies, and its time before and after the centre, periods.
HIGHEST, BEFORE, AFTER = 1.54, 3.5, 12.0
SAMPLES_A_PERIOD = 8

# Our simulator: nodes in the shortest wave (an inversion has 4.5), order in space (8) and time step.
OWN_NODES_A_WAVE, OWN_ORDER, OWN_STEP, EDGE_NODES = 9.0, 6, 0.6, 40

# Of k-Wave, whose derivatives in space are exact for waves of two nodes.
PEER_NODES_A_WAVE = 4.0


@dataclass(frozen=True)
class RingScan:
    """A ring in a square, centred on 0.

    Attributes:
        side_m: of the square that is simulated, m.
        radius_m: of the ring, m.
        centre_hz: centre frequency of the pulse, Hz.
        elements: of the ring, all of which receive.
        emissions: of elements evenly around it.
        speeds_mps: the lowest and the highest of all objects, m/s.
        water_mps: speed of the water, m/s.
        peer: k-Wave, or None: our simulator.
        peer_step: its time step, in the longest of ours.
        nodes_a_wave: nodes of our grid in the shortest wave.
        before: time before the centre of the pulse, periods.
        record_s: of the recording, s; None: until the slowest way across and the end of the pulse.
        turn: of the first element, in the distance of two.
        on_nodes: whether elements lie on nodes of our grid too, and do not hear themselves.
    """

    side_m: float
    radius_m: float
    centre_hz: float
    elements: int
    emissions: int
    speeds_mps: tuple[float, float]
    water_mps: float
    peer: Peer | None = None
    peer_step: float = 0.5
    nodes_a_wave: float = OWN_NODES_A_WAVE
    before: float = BEFORE
    record_s: float | None = None
    turn: float = 0.0
    on_nodes: bool = True

    @property
    def nodes(self) -> int:
        """Along a side of the simulation."""
        a_wave = PEER_NODES_A_WAVE if self.peer else self.nodes_a_wave
        return math.ceil(self.side_m * a_wave * HIGHEST * self.centre_hz / self.speeds_mps[0]) + 1

    @property
    def spacing_m(self) -> float:
        """Node spacing, m."""
        return self.side_m / (self.nodes - 1)

    @property
    def rate_hz(self) -> float:
        """Sampling rate of the traces, Hz."""
        return SAMPLES_A_PERIOD * self.centre_hz

    def ring(self) -> Floats:
        """Places of the elements in the grid, (elements, 2), nodes; of k-Wave always whole ones."""
        turn = 2.0 * np.pi * (np.arange(self.elements) + self.turn) / self.elements
        position = self.radius_m * np.column_stack((np.cos(turn), np.sin(turn)))
        place = (position + 0.5 * self.side_m) / self.spacing_m
        return np.rint(place) if self.on_nodes or self.peer else place

    def emitters(self) -> Ints:
        """Indices of the emitting elements."""
        return np.arange(self.emissions) * self.elements // self.emissions

    def recorded(
        self, speeds: Mapping[str, Floats], progress: Step, threads: int = 2
    ) -> dict[str, np.ndarray]:
        """Traces of each object, (emissions, elements, samples); an element does not hear itself.

        Args:
            speeds: by name, speed at the nodes, (nodes, nodes), m/s.
            progress: of the emissions.
            threads: that simulate at the same time.
        """
        fraction = self.peer_step if self.peer else OWN_STEP
        skip = math.ceil(1.0 / (self.rate_hz * fraction * longest_step(self.speeds_mps[1], self.spacing_m)))
        step = 1.0 / (self.rate_hz * skip)
        longest_s = 2.0 * self.radius_m / self.speeds_mps[0] + (self.before + AFTER) / self.centre_hz
        samples = round((self.record_s or longest_s) * self.rate_hz)
        late = step * np.arange(samples * skip) * self.centre_hz - self.before
        pulse = np.exp(-((0.9 * late) ** 2)) * np.sin(2.0 * np.pi * late)
        recorded = {}
        for name, speed in speeds.items():
            shoot = self._shooter(speed, step, pulse)
            shots = np.zeros((self.emissions, self.elements, samples), np.float32)
            with ThreadPoolExecutor(threads) as pool:
                for number, traces in enumerate(pool.map(shoot, self.emitters())):
                    progress(number, self.emissions, f"waves, {name}")
                    shots[number] = traces[:, ::skip]
            recorded[name] = shots
        return recorded

    def _shooter(self, speed: Floats, step: float, pulse: Floats) -> Callable[[int], np.ndarray]:
        """Simulates the emission of an element, (elements, steps)."""
        if self.peer is not None:
            return partial(
                _shot_of_peer, self.peer, speed, self.spacing_m, step, self.ring().astype(int), pulse
            )
        medium = Medium.from_speed(speed, self.spacing_m, step, edge_nodes=EDGE_NODES, order=OWN_ORDER)
        return partial(_own_shot, medium, self.ring() * self.spacing_m, pulse, self.on_nodes)

    def dataset(self, traces: np.ndarray, water: np.ndarray, speed: Floats, roi: Flags | None) -> Dataset:
        """A scan with its water shot and its truth.

        Args:
            traces, water: as of ``recorded``.
            speed: true speed at the nodes, m/s.
            roi: region of the errors, at the nodes.
        """
        corner = -0.5 * self.side_m
        maker = (
            "k-Wave" if self.peer else f"order {OWN_ORDER} in space, {self.nodes_a_wave:g} nodes in a wave"
        )
        return Dataset(
            element_position_m=self.ring() * self.spacing_m + corner,
            tx=self.emitters(),
            rx=np.arange(self.elements),
            water_speed_mps=self.water_mps,
            waveform=Waveform(traces, water),
            roi=roi,
            truth=Truth(speed, (self.spacing_m,) * 2, (corner, corner)),
            radius_m=self.radius_m,
            center_frequency_hz=self.centre_hz,
            sampling_rate_hz=self.rate_hz,
            t0_s=-self.before / self.centre_hz,
            source=f"made by {maker}",
        )


def _shot_of_peer(
    peer: Peer, speed: Floats, spacing: float, step: float, ring: Ints, pulse: Floats, element: int
) -> np.ndarray:
    traces = np.zeros((len(ring), pulse.size), np.float32)
    others = np.delete(np.arange(len(ring)), element)
    traces[others] = peer(speed, spacing, step, ring[element], ring[others], pulse)
    return traces


def _own_shot(medium: Medium, ring: Floats, pulse: Floats, deaf: bool, element: int) -> np.ndarray:
    traces = simulate(medium, ring[element], ring, pulse)
    if deaf:
        traces[element] = 0.0
    return traces

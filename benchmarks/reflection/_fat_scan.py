"""Weak points, a thin line and a cyst in speckle, behind thick fat and in water alone, scanned by waves."""

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.ndimage import gaussian_filter

from bentray_kernels.acquisition import Dataset, Truth, Waveform
from bentray_kernels.arrays import Floats, Ints
from bentray_kernels.wave.medium import Medium
from bentray_kernels.wave.simulation import simulate
from bentray_kernels.wave.stencil import longest_step

from ..waves._kwave_peer import Peer

# Water of 35 °C and a gland of nearly its speed in fat, m/s; radii of gland, fat and ring, m.
WATER_MPS, FAT_MPS, GLAND_MPS = 1520.0, 1375.0, 1510.0
GLAND_M, FAT_M, RING_M, SIDE_M = 0.012, 0.041, 0.047, 0.098

# Targets, m: points, a line from one end to the other, and a cyst, in which there is no speckle.
POINTS = ((-0.006, 0.005), (0.006, 0.006), (0.0, -0.0075))
LINE = ((-0.0095, -0.002), (-0.0055, -0.002))
CYST, CYST_M = (0.0035, -0.001), 0.0025

# Contrast of targets and rms of the speckle, relative to the speed; radius of a point and of the line, and
# size of a grain, wavelengths.
CONTRAST, SPECKLE, THIN, GRAIN = 0.06, 0.004, 0.2, 0.15

# Nodes in the shortest wave, order in space and time step: not those of any inversion here (4.5, order 8).
NODES_A_WAVE, HIGHEST, ORDER, STEP, EDGE_NODES = 5.0, 1.54, 6, 0.6, 40
# Of k-Wave, whose derivatives in space are exact for waves of two nodes.
PEER_NODES_A_WAVE, PEER_STEP = 4.0, 0.5
SAMPLES_A_PERIOD, BEFORE, RECORD_S = 8, 2.5, 98e-6


@dataclass(frozen=True)
class FatScan:
    """Size of a scan: centre frequency, Hz; elements; emitting elements; k-Wave, or None: ours."""

    frequency_hz: float = 1e6
    elements: int = 192
    emissions: int = 24
    peer: Peer | None = None

    @property
    def wavelength_m(self) -> float:
        """In water, m."""
        return WATER_MPS / self.frequency_hz

    @property
    def nodes(self) -> int:
        """Along a side of the simulation."""
        a_wave = PEER_NODES_A_WAVE if self.peer else NODES_A_WAVE
        return math.ceil(SIDE_M * a_wave * HIGHEST * self.frequency_hz / FAT_MPS) + 1

    @property
    def spacing_m(self) -> float:
        """Node spacing, m."""
        return SIDE_M / (self.nodes - 1)

    def node_positions(self) -> tuple[Floats, Floats]:
        """x and y of the nodes, (nodes, nodes) each, m, origin at the centre of the ring."""
        line = self.spacing_m * np.arange(self.nodes) - 0.5 * SIDE_M
        x, y = np.meshgrid(line, line, indexing="ij")
        return x, y

    def speed(self, *, fat: bool, targets: bool) -> Floats:
        """Speed of sound at the nodes, m/s; without fat all is water but the targets."""
        x, y = self.node_positions()
        radius = np.hypot(x, y)
        within = [np.clip(0.5 - (radius - edge) / self.spacing_m, 0.0, 1.0) for edge in (FAT_M, GLAND_M)]
        speed = np.full_like(x, WATER_MPS)
        if fat:
            speed += (FAT_MPS - WATER_MPS) * within[0] + (GLAND_MPS - FAT_MPS) * within[1]
        return speed * (1.0 + self._targets(x, y)) if targets else speed

    def _targets(self, x: Floats, y: Floats) -> Floats:
        """Relative changes of the speed by targets and speckle."""
        thin = THIN * self.wavelength_m
        grains = gaussian_filter(
            np.random.default_rng(7).standard_normal(x.shape), GRAIN * self.wavelength_m / self.spacing_m
        )
        clear = np.hypot(x, y) > GLAND_M - self.wavelength_m
        clear |= np.hypot(x - CYST[0], y - CYST[1]) < CYST_M
        away = [np.hypot(x - px, y - py) for px, py in POINTS]
        along = np.clip(x, LINE[0][0], LINE[1][0])
        away.append(np.hypot(x - along, y - LINE[0][1]))
        change = np.where(clear, 0.0, SPECKLE * grains / grains.std())
        for distance in away:
            change += CONTRAST * np.exp(-((distance / thin) ** 2))
        return np.asarray(change)

    def ring_m(self) -> Floats:
        """Elements, (elements, 2), m; those of k-Wave are on nodes."""
        turn = 2.0 * np.pi * (np.arange(self.elements) + 0.3) / self.elements
        ring = RING_M * np.column_stack((np.cos(turn), np.sin(turn)))
        return ring if self.peer is None else self.spacing_m * self._ring_nodes(ring) - 0.5 * SIDE_M

    def _ring_nodes(self, ring: Floats) -> Ints:
        return np.rint((ring + 0.5 * SIDE_M) / self.spacing_m).astype(int)

    def simulated(
        self,
        progress: Callable[[int, int, str], None],
        names: Sequence[str] = ("behind fat", "in water"),
        threads: int = 2,
    ) -> dict[str, Dataset]:
        """The scans ``behind fat`` and ``in water``, or some of them, each with its water shot."""
        step, skip = self._clock()
        samples = int(RECORD_S * SAMPLES_A_PERIOD * self.frequency_hz)
        late = step * self.frequency_hz * np.arange(samples * skip) - BEFORE
        pulse = np.exp(-((0.9 * late) ** 2)) * np.sin(2.0 * np.pi * late)
        ring = self.ring_m() + 0.5 * SIDE_M
        tx = np.arange(self.emissions) * self.elements // self.emissions
        speeds = {
            "behind fat": self.speed(fat=True, targets=True),
            "in water": self.speed(fat=False, targets=True),
            "water shot": self.speed(fat=False, targets=False),
        }
        shots = {}
        for name in (*names, "water shot"):
            speed = speeds[name]
            if self.peer is None:
                medium = Medium.from_speed(speed, self.spacing_m, step, edge_nodes=EDGE_NODES, order=ORDER)
                shoot = partial(_shot, medium, ring, pulse, skip)
            else:
                nodes = self._ring_nodes(self.ring_m())
                shoot = partial(_shot_of_peer, self.peer, speed, self.spacing_m, step, nodes, pulse, skip)
            with ThreadPoolExecutor(threads) as pool:
                recorded = []
                for number, traces in enumerate(pool.map(shoot, tx)):
                    progress(number + 1, len(tx), f"waves {name}")
                    recorded.append(traces)
            shots[name] = np.stack(recorded)
        solver = f"order {ORDER} in space" if self.peer is None else "k-Wave"
        corner, truth = -0.5 * SIDE_M, self.speed(fat=True, targets=False)
        return {
            name: Dataset(
                element_position_m=self.ring_m(),
                tx=tx,
                rx=np.arange(self.elements),
                water_speed_mps=WATER_MPS,
                waveform=Waveform(shots[name], shots["water shot"]),
                truth=Truth(truth, (self.spacing_m,) * 2, (corner, corner)) if name == "behind fat" else None,
                radius_m=RING_M,
                center_frequency_hz=self.frequency_hz,
                sampling_rate_hz=SAMPLES_A_PERIOD * self.frequency_hz,
                t0_s=-BEFORE / self.frequency_hz,
                source=f"{solver}, {self.nodes} nodes of {1e3 * self.spacing_m:.3g} mm a side",
            )
            for name in names
        }

    def _clock(self) -> tuple[float, int]:
        """Time step, s, and steps from sample to sample."""
        step = STEP if self.peer is None else PEER_STEP
        longest = step * longest_step(1.1 * WATER_MPS, self.spacing_m)
        sample = 1.0 / (SAMPLES_A_PERIOD * self.frequency_hz)
        skip = math.ceil(sample / longest)
        return sample / skip, skip


def _shot_of_peer(
    peer: Peer, speed: Floats, spacing: float, step: float, ring: Ints, pulse: Floats, skip: int, emitter: int
) -> np.ndarray:
    others = np.delete(np.arange(len(ring)), emitter)
    traces = np.zeros((len(ring), len(pulse[::skip])), np.float32)
    traces[others] = peer(speed, spacing, step, ring[emitter], ring[others], pulse)[:, ::skip]
    return traces


def _shot(medium: Medium, ring: Floats, pulse: Floats, skip: int, emitter: int) -> np.ndarray:
    return simulate(medium, ring[emitter], ring, pulse)[:, ::skip].astype(np.float32)

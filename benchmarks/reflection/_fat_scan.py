"""Weak points, a thin line and a cyst in speckle, behind thick fat and in water alone, scanned by waves."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.ndimage import gaussian_filter

from bentray_kernels.acquisition import Dataset
from bentray_kernels.arrays import Floats
from bentray_service.cli.output.terminal import Step

from ..shared._ring_scan import RingScan
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

# Nodes in the shortest wave, not those of any inversion here (4.5); periods before the pulse; recording, s.
NODES_A_WAVE, BEFORE, RECORD_S = 5.0, 2.5, 98e-6


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

    @cached_property
    def ring(self) -> RingScan:
        """The ring around it."""
        return RingScan(
            SIDE_M,
            RING_M,
            self.frequency_hz,
            self.elements,
            self.emissions,
            (FAT_MPS, 1.1 * WATER_MPS),
            WATER_MPS,
            self.peer,
            nodes_a_wave=NODES_A_WAVE,
            before=BEFORE,
            record_s=RECORD_S,
            turn=0.3,
            on_nodes=False,
        )

    def node_positions(self) -> tuple[Floats, Floats]:
        """x and y of the nodes, (nodes, nodes) each, m, origin at the centre of the ring."""
        line = self.ring.spacing_m * np.arange(self.ring.nodes) - 0.5 * SIDE_M
        x, y = np.meshgrid(line, line, indexing="ij")
        return x, y

    def speed(self, *, fat: bool, targets: bool) -> Floats:
        """Speed of sound at the nodes, m/s; without fat all is water but the targets."""
        x, y = self.node_positions()
        radius = np.hypot(x, y)
        within = [np.clip(0.5 - (radius - edge) / self.ring.spacing_m, 0.0, 1.0) for edge in (FAT_M, GLAND_M)]
        speed = np.full_like(x, WATER_MPS)
        if fat:
            speed += (FAT_MPS - WATER_MPS) * within[0] + (GLAND_MPS - FAT_MPS) * within[1]
        return speed * (1.0 + self._targets(x, y)) if targets else speed

    def _targets(self, x: Floats, y: Floats) -> Floats:
        """Relative changes of the speed by targets and speckle."""
        thin = THIN * self.wavelength_m
        grains = gaussian_filter(
            np.random.default_rng(7).standard_normal(x.shape), GRAIN * self.wavelength_m / self.ring.spacing_m
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

    def simulated(
        self, progress: Step, names: Sequence[str] = ("behind fat", "in water"), threads: int = 2
    ) -> dict[str, Dataset]:
        """The scans ``behind fat`` and ``in water``, or some of them, each with its water shot."""
        speeds = {
            "behind fat": self.speed(fat=True, targets=True),
            "in water": self.speed(fat=False, targets=True),
            "water shot": self.speed(fat=False, targets=False),
        }
        shots = self.ring.recorded({name: speeds[name] for name in (*names, "water shot")}, progress, threads)
        truth = self.speed(fat=True, targets=False)
        scans = {name: self.ring.dataset(shots[name], shots["water shot"], truth, None) for name in names}
        if "in water" in scans:
            scans["in water"] = replace(scans["in water"], truth=None)
        return scans

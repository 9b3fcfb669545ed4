"""A 2-D wave simulation of a ring scan: settings, one emission, and the dataset."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from distributed.system import MEMORY_LIMIT
from numpy.typing import NDArray

from bentray_kernels.acquisition import Dataset, Truth, Waveform
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.arrays import Floats
from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import DetailedBreast, EllipsePhantom
from bentray_kernels.phantoms.volume import PhantomSlice
from bentray_kernels.requests.limits import SPEED_MPS
from bentray_kernels.requests.ranges import SEED, Range, check_ranges, ranged
from bentray_kernels.wave.medium import Medium
from bentray_kernels.wave.points import REACH
from bentray_kernels.wave.simulation import simulate
from bentray_kernels.wave.stencil import longest_step, phase_error
from bentray_kernels.wave.time_blocks import Poll, no_poll

from .plane import SIDES_M, TITLES, PlanePhantom, plane_phantom, ring_radius
from .ranges import DEFAULT_EMISSIONS, EMISSIONS, FREQUENCY_HZ, NODES, SIDE_M, SNR
from .shared_media import made_once

# The pulse is a sine with a Gaussian envelope; at this multiple of its centre frequency its spectrum has 3 %
# of its maximum.
HIGHEST = 1.54

# Unlike the simulations of a refinement (optimised weights, 4 nodes per wavelength at the upper corner), so
# that data are not inverted with the model that made them; and the time step over the longest stable one.
ORDER, NODES_A_WAVE, STEP = 6, 7.0, 0.5

# Of the absorbing boundary; wider than that of a refinement.
EDGE_NODES = 40

# Larger grids take too long.
MAX_NODES = 8192**2

# Recorded samples in a period of the centre frequency.
SAMPLES_A_PERIOD = 8

# Periods of the pulse before its centre, and of the record after the slowest arrival.
BEFORE, AFTER = 2.5, 12.0


@dataclass(frozen=True)
class WaveSimulationSettings:
    """A ring scan by 2-D wave simulation.

    Attributes:
        frequency_hz: centre frequency of the pulse, Hz.
        side_m: of the square around phantom and ring, m; the phantom fills the same part of it as in the
            0.2 m of the dissertation.
        elements: of the ring, each a receiver.
        emissions: number of emitting elements, evenly spaced.
        nodes: along a side of the truth image.
        coupling_mps: speed of the water, m/s.
        snr: peak of the water traces (median over all) relative to the standard deviation of Gaussian noise
            on every trace; None: no noise.
        seed: of the noise.
    """

    frequency_hz: float = ranged(5e5, FREQUENCY_HZ)
    side_m: float = ranged(0.12, SIDE_M)
    elements: int = ranged(128, Range(8, 4096))
    emissions: int = ranged(DEFAULT_EMISSIONS, EMISSIONS)
    nodes: int = ranged(256, NODES)
    coupling_mps: float = ranged(1500.0, SPEED_MPS)
    snr: float | None = ranged(None, SNR)
    seed: int = ranged(0, SEED)

    # These differ in 3-D.
    dimensions: ClassVar[int] = 2
    edge_nodes: ClassVar[int] = EDGE_NODES
    plane: ClassVar[PlanePhantom] = "table6"
    phantom_side_m: ClassVar[float] = SIDES_M["table6"]
    phantom_name: ClassVar[str] = TITLES["table6"]

    def __post_init__(self) -> None:
        check_ranges(self)
        if not 1 <= self.emissions <= self.elements:
            raise InvalidInput("emissions", self.emissions, f"1 to {self.elements}")
        size = math.prod(self.grid)
        if size > MAX_NODES:
            most = self.frequency_hz * (MAX_NODES / size) ** (1.0 / self.dimensions)
            raise InvalidInput("frequency_hz", self.frequency_hz, f"at most {most:.3g} for this side")

    @property
    def phantom(self) -> EllipsePhantom | DetailedBreast | PhantomSlice:
        """The phantom in the plane of the ring."""
        return plane_phantom(self.plane, self.coupling_mps)

    @property
    def grid(self) -> tuple[int, ...]:
        """Nodes of the simulation along each axis."""
        return self.fine_nodes, self.fine_nodes

    def places_m(self) -> Floats:
        """Elements in the medium, (elements, dimensions), m, node 0 at 0."""
        return self.elements_m() + 0.5 * self.side_m

    def speed(self) -> Floats:
        """Speed of sound of the object on the grid, m/s."""
        return self.phantom.speed(self.fine_nodes, self.phantom_side_m)

    @property
    def speeds(self) -> tuple[float, float]:
        """Lowest and highest in the medium, m/s."""
        low, high = self.phantom.speed_range()
        return min(low, self.coupling_mps), max(high, self.coupling_mps)

    @property
    def fine_nodes(self) -> int:
        """Along a side of the simulation's grid."""
        wave = self.speeds[0] / (HIGHEST * self.frequency_hz)
        return int(np.ceil(self.side_m * NODES_A_WAVE / wave)) + 2 * REACH

    @property
    def grid_text(self) -> str:
        """The grid in words."""
        return " by ".join(str(nodes) for nodes in self.grid)

    @property
    def spacing_m(self) -> float:
        """Spacing of that grid, m."""
        return self.side_m / (self.fine_nodes - 1)

    @property
    def skip(self) -> int:
        """Time steps from one recorded sample to the next."""
        longest = STEP * longest_step(self.speeds[1], self.spacing_m, dimensions=self.dimensions)
        return int(np.ceil(1.0 / (SAMPLES_A_PERIOD * self.frequency_hz) / longest))

    @property
    def step_s(self) -> float:
        """Time step, s."""
        return 1.0 / (SAMPLES_A_PERIOD * self.frequency_hz * self.skip)

    @property
    def samples(self) -> int:
        """Samples of each trace."""
        longest = 2.0 * ring_radius(self.side_m, self.nodes) / self.speeds[0]
        return int(SAMPLES_A_PERIOD * (longest * self.frequency_hz + BEFORE + AFTER))

    @property
    def dispersion(self) -> tuple[float, float]:
        """Relative errors of the phase speed at the centre and at the highest frequency of the pulse."""
        courant = self.coupling_mps * self.step_s / self.spacing_m
        waves = (self.coupling_mps / (times * self.frequency_hz) for times in (1.0, HIGHEST))
        centre, highest = (phase_error(wave / self.spacing_m, courant, order=ORDER) for wave in waves)
        return centre, highest

    def elements_m(self) -> Floats:
        """Positions, (elements, 2), m, origin at the centre."""
        return Ring(self.elements, ring_radius(self.side_m, self.nodes)).positions()

    def senders(self) -> NDArray[np.int64]:
        """Emitting elements, (emissions,)."""
        return np.arange(self.emissions) * self.elements // self.emissions


@dataclass(frozen=True)
class VerticalWaveSettings(WaveSimulationSettings):
    """Like ``WaveSimulationSettings`` in the vertical slice of the phantom."""

    plane: ClassVar[PlanePhantom] = "table6-vertical"
    phantom_side_m: ClassVar[float] = SIDES_M["table6-vertical"]
    phantom_name: ClassVar[str] = TITLES["table6-vertical"]


@dataclass(frozen=True)
class DetailedWaveSettings(WaveSimulationSettings):
    """Like ``WaveSimulationSettings`` in the breast with glandular texture."""

    plane: ClassVar[PlanePhantom] = "detailed"
    phantom_side_m: ClassVar[float] = SIDES_M["detailed"]
    phantom_name: ClassVar[str] = TITLES["detailed"]


@dataclass(frozen=True)
class BreastWaveSettings(WaveSimulationSettings):
    """Like ``WaveSimulationSettings`` in the breast with large lesions."""

    plane: ClassVar[PlanePhantom] = "breast"
    phantom_side_m: ClassVar[float] = SIDES_M["breast"]
    phantom_name: ClassVar[str] = TITLES["breast"]


class Noise:
    """Noise of traces, drawn per emission: first all of the object, then of the water.

    Args:
        settings: with an ``snr``.
        peaks: maximum of each water trace, (emissions, elements).
    """

    def __init__(self, settings: WaveSimulationSettings, peaks: NDArray[np.float32]) -> None:
        assert settings.snr is not None
        self._random = np.random.default_rng(settings.seed)
        self._sigma = float(np.median(peaks)) / settings.snr
        self._shape = settings.elements, settings.samples

    def drawn(self) -> NDArray[np.float32]:
        """The noise of the next emission, (elements, samples)."""
        return (self._sigma * self._random.standard_normal(self._shape)).astype(np.float32)


def scan_of(settings: WaveSimulationSettings, waveform: Waveform) -> Dataset:
    """The dataset of traces, or of placeholders for them."""
    phantom = settings.phantom
    spacing = settings.side_m / (settings.nodes - 1)
    low, high = settings.dispersion
    return Dataset(
        element_position_m=settings.elements_m(),
        tx=settings.senders(),
        rx=np.arange(settings.elements),
        water_speed_mps=settings.coupling_mps,
        waveform=waveform,
        roi=phantom.inside(settings.nodes, settings.phantom_side_m),
        truth=Truth(
            sound_speed_mps=phantom.speed(settings.nodes, settings.phantom_side_m),
            spacing_m=(spacing, spacing),
            origin_m=(-0.5 * settings.side_m, -0.5 * settings.side_m),
        ),
        radius_m=ring_radius(settings.side_m, settings.nodes),
        center_frequency_hz=settings.frequency_hz,
        sampling_rate_hz=SAMPLES_A_PERIOD * settings.frequency_hz,
        t0_s=-BEFORE / settings.frequency_hz,
        title=(
            f"{settings.phantom_name}, {1e3 * settings.side_m:g} mm, "
            f"waves of {1e-3 * settings.frequency_hz:g} kHz"
        ),
        source=(
            f"made by bentray simulate: order {ORDER} in space, {settings.grid_text} nodes of "
            f"{1e3 * settings.spacing_m:.3g} mm, phase speed wrong by {low:.1e} in the middle of the pulse "
            f"and {high:.1e} at its highest frequency"
        ),
        license="CC0-1.0",
    )


def simulate_emission(
    settings: WaveSimulationSettings, emission: int, poll: Poll = no_poll
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Object and water traces of an emission, (elements, samples); on ``poll`` see ``time_blocks``."""
    positions = settings.places_m()
    at = positions[settings.senders()[emission]]
    time = settings.step_s * np.arange(settings.samples * settings.skip) - BEFORE / settings.frequency_hz
    late = time * settings.frequency_hz
    pulse = np.exp(-((0.9 * late) ** 2)) * np.sin(2.0 * np.pi * late)
    received, water = (
        simulate(medium, at, positions, pulse, poll)[:, :: settings.skip] for medium in _media(settings)
    )
    return received.astype(np.float32), water.astype(np.float32)


@made_once(1)
def _media(settings: WaveSimulationSettings) -> tuple[Medium, Medium]:
    """Media of object and water."""
    received, water = (
        Medium.from_speed(
            speed,
            settings.spacing_m,
            settings.step_s,
            edge_nodes=settings.edge_nodes,
            memory_bytes=MEMORY_LIMIT or math.inf,
            order=ORDER,
        )
        for speed in (settings.speed(), np.full(settings.grid, settings.coupling_mps))
    )
    return received, water

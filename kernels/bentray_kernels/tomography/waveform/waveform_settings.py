"""The settings of a waveform refinement: bands of frequency from low to high, and what holds in all."""

from __future__ import annotations

from dataclasses import MISSING, dataclass
from typing import NamedTuple

from ...errors import InvalidInput
from ...limits import SPACING_M, SPEED_MPS
from ...ranges import SEED, Range, check_ranges, ranged
from ...wave.simulation import Unknown
from .misfits import Misfit, correlation, least_squares

# Of a band, around those that every pulse of a scan asks for.
CORNER_HZ = Range(1e2, 1e11, unit="Hz")
# Wide enough for every record and every array.
WINDOW_S = Range(0.0, 1.0, above=True, unit="s")
DISTANCE_M = Range(0.0, 100.0, unit="m")
STEP_MPS = Range(0.0, SPEED_MPS.most, above=True, unit="m/s")


@dataclass(frozen=True)
class Band:
    """One step of the continuation in frequency.

    Attributes:
        low_hz, high_hz: corners of the filter, Hz.
        spacing_m: of the grid, m; the shortest wave needs 2.5 nodes.
        iterations: at most.
        emitters: how many are used, drawn at random; all where there are no more.
        smoothing_m: standard deviation of the Gaussian on gradients, m; it should shrink with the frequency.
        of: what is refined; the other stays as it is.
    """

    low_hz: float = ranged(MISSING, CORNER_HZ)
    high_hz: float = ranged(MISSING, CORNER_HZ)
    spacing_m: float = ranged(MISSING, SPACING_M)
    iterations: int = ranged(10, Range(1, 1000))
    emitters: int = ranged(32, Range(1, 65_536))
    smoothing_m: float = ranged(2e-3, DISTANCE_M)
    of: Unknown = "speed"

    def __post_init__(self) -> None:
        check_ranges(self)
        if self.low_hz >= self.high_hz:
            raise InvalidInput("band_hz", (self.low_hz, self.high_hz), "low_hz < high_hz, in Hz")

    def evaluations(self, held_out: int) -> int:
        """Looks of single emitters at images, the first one included; shortened steps take more."""
        return (self.iterations + 1) * (self.emitters + held_out)


def bands(centre_hz: float, water_mps: float = 1500.0) -> tuple[Band, ...]:
    """The continuation for a pulse: half its centre frequency, three quarters, one and an eighth, 1.5 times.

    Grids have 5 to 4.5 nodes in the water's wave at the upper corner.

    Args:
        centre_hz: of the pulse, Hz.
        water_mps: speed of the water, m/s.
    """
    wave = water_mps / centre_hz
    return (
        Band(0.25 * centre_hz, 0.5 * centre_hz, wave / 2.5, 8, 32, 0.8 * wave),
        Band(0.25 * centre_hz, 0.75 * centre_hz, wave / 3.75, 12, 32, 0.53 * wave),
        Band(0.25 * centre_hz, 1.125 * centre_hz, wave / 5.0, 16, 40, 0.2 * wave),
        Band(0.25 * centre_hz, 1.5 * centre_hz, wave / 6.8, 8, 32, 0.13 * wave),
    )


def loss_band(centre_hz: float, water_mps: float = 1500.0) -> Band:
    """The band in which the attenuation is refined once the speed is: that of the pulse about its centre.

    It ends early, because errors of the speed are soon fitted as attenuation
    (``benchmarks/results/raw_trace_experiments.md``).

    Args:
        centre_hz: of the pulse, Hz.
        water_mps: speed of the water, m/s.
    """
    wave = water_mps / centre_hz
    return Band(0.75 * centre_hz, 1.125 * centre_hz, wave / 5.0, 4, 20, 0.5 * wave, "attenuation")


class Steps(NamedTuple):
    """How far an image may go, in its unit.

    Attributes:
        bounds: lowest and highest value of a node.
        first: rms of the first change of a band, before anything is known of the curvature.
        largest: highest rms change in one iteration.
    """

    bounds: tuple[float, float]
    first: float
    largest: float


# Of the attenuation beyond the water's, Np/m: tissue has 3 to 10 at 500 kHz, bone ten times as much.
LOSS_STEPS = Steps((0.0, 100.0), 0.5, 4.0)


@dataclass(frozen=True)
class WaveSettings:
    """How to refine.

    Attributes:
        bands: gone through in order, each from the image of the one before.
        window_s: (before, after) the arrival in water that traces are compared within, s.
        nearest_m: pairs nearer than this are left out, m.
        speed_bounds_mps: (lowest, highest) speed that a node may take, m/s.
        largest_step_mps: highest rms change of the image in one iteration, m/s.
        first_step_mps: rms of the first change of a band, m/s, before anything is known of the curvature.
        memory: pairs of changes that the curvature is read from (L-BFGS).
        held_out: emitters that only judge.
        seed: of the draw of emitters.
        roi: let only the dataset's region of interest change (``mask/roi``).
    """

    bands: tuple[Band, ...]
    window_s: tuple[float, float] = (60e-6, 40e-6)
    nearest_m: float = ranged(0.03, DISTANCE_M)
    speed_bounds_mps: tuple[float, float] = (1350.0, 1650.0)
    largest_step_mps: float = ranged(12.0, STEP_MPS)
    first_step_mps: float = ranged(2.0, STEP_MPS)
    memory: int = ranged(8, Range(1, 1000))
    held_out: int = ranged(4, Range(0, 65_536))
    seed: int = ranged(0, SEED)
    roi: bool = False

    def __post_init__(self) -> None:
        if not self.bands:
            raise InvalidInput("bands", "none", "at least one band")
        check_ranges(self)
        low, high = self.speed_bounds_mps
        least, most = SPEED_MPS.least, SPEED_MPS.most
        if not least <= low < high <= most:
            raise InvalidInput(
                "speed_bounds_mps", self.speed_bounds_mps, f"{least:g} <= lowest < highest <= {most:g} m/s"
            )
        for end in self.window_s:
            WINDOW_S.check("window_s", end)

    def steps(self, of: Unknown) -> Steps:
        """How far an image of speed or attenuation may go."""
        if of == "attenuation":
            return LOSS_STEPS
        return Steps(self.speed_bounds_mps, self.first_step_mps, self.largest_step_mps)

    def measure(self, of: Unknown) -> Misfit:
        """What is made small to find speed or attenuation."""
        return correlation if of == "speed" else least_squares

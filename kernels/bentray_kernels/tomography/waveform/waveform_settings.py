"""Settings of a full-waveform refinement: frequency bands from low to high, and the settings of all bands."""

from dataclasses import MISSING, dataclass
from typing import Literal, NamedTuple

from ...errors import InvalidInput
from ...requests.limits import SPACING_M, check_speeds
from ...requests.ranges import SEED, Range, check_ranges, ranged
from ...wave.emissions import Engine
from ...wave.simulation import Unknown
from .misfits import Misfit, correlation, least_squares

# Corners of a band, with a margin around those of all pulses of scans.
CORNER_HZ = Range(1e2, 1e11, unit="Hz")
# Wide enough for every record and every array.
WINDOW_S = Range(0.0, 1.0, above=True, unit="s")
DISTANCE_M = Range(0.0, 100.0, unit="m")


@dataclass(frozen=True)
class Band:
    """One step of the continuation in frequency.

    Attributes:
        low_hz, high_hz: corners of the filter, Hz.
        spacing_m: of the grid, m; the shortest wave needs 2 nodes.
        iterations: at most.
        emitters: number of emitters, drawn at random; all where there are no more.
        smoothing_m: standard deviation of the Gaussian on gradients, m; should decrease with the frequency.
        of: the unknown; the other one is fixed.
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
        """Emitter passes, including those of the first image; shortened steps take more."""
        return (self.iterations + 1) * (self.emitters + held_out)


def bands(centre_hz: float, water_mps: float = 1500.0) -> tuple[Band, ...]:
    """The continuation for a pulse, up to 0.5, 0.75, 1.125 and 1.5 times its centre frequency.

    Grids have 4 nodes per wavelength in water at the upper corner, for which the Laplacian is optimised.

    Args:
        centre_hz: of the pulse, Hz.
        water_mps: speed of the water, m/s.
    """
    wave = water_mps / centre_hz
    return (
        Band(0.25 * centre_hz, 0.5 * centre_hz, wave / 2.0, 8, 32, 0.8 * wave),
        Band(0.25 * centre_hz, 0.75 * centre_hz, wave / 3.0, 12, 32, 0.53 * wave),
        Band(0.25 * centre_hz, 1.125 * centre_hz, wave / 4.0, 16, 40, 0.2 * wave),
        Band(0.25 * centre_hz, 1.5 * centre_hz, wave / 6.2, 8, 32, 0.13 * wave),
    )


def loss_band(centre_hz: float, water_mps: float = 1500.0) -> Band:
    """The band of the attenuation, around the centre of the pulse, after all bands of the speed.

    It has few iterations, because errors of the speed are soon fitted as attenuation
    (``benchmarks/results/raw_trace_experiments.md``).

    Args:
        centre_hz: of the pulse, Hz.
        water_mps: speed of the water, m/s.
    """
    wave = water_mps / centre_hz
    return Band(0.75 * centre_hz, 1.125 * centre_hz, wave / 4.0, 4, 20, 0.5 * wave, "attenuation")


class Steps(NamedTuple):
    """Limits of the values and steps of an image, in its unit.

    Attributes:
        bounds: lowest and highest value of a node.
        first: rms of the first step of a band, before the curvature is known.
        largest: highest rms of a step.
    """

    bounds: tuple[float, float]
    first: float
    largest: float


# Attenuation beyond the water's, Np/m: tissue has 3 to 10 at 500 kHz, bone ten times as much.
LOSS_STEPS = Steps((0.0, 100.0), 0.5, 4.0)


@dataclass(frozen=True)
class WaveSettings:
    """Settings of a refinement.

    Attributes:
        bands: in order, each starting from the image of the previous one.
        window_s: (before, after) the arrival in water, the window in which traces are compared, s.
        nearest_m: pairs nearer than this are left out, m.
        speed_bounds_mps: (lowest, highest) speed of a node, m/s.
        held_out: number of emitters used only for validation.
        seed: of the draw of emitters.
        roi: whether only the dataset's region of interest may change (``mask/roi``).
        opening_angle_deg: pairs outside this angle are left out, see ``directivity``; None: no pair is.
        estimates_source: whether the source is estimated anew in each band from the traces of the object.
        engine: that simulates the waves.
        half: 0 or 1, that half of the emitters of each band alone; None: all of them.
    """

    bands: tuple[Band, ...]
    window_s: tuple[float, float] = (60e-6, 40e-6)
    nearest_m: float = ranged(0.03, DISTANCE_M)
    speed_bounds_mps: tuple[float, float] = (1350.0, 1650.0)
    held_out: int = ranged(4, Range(0, 65_536))
    seed: int = ranged(0, SEED)
    roi: bool = False
    opening_angle_deg: float | None = None
    estimates_source: bool = False
    engine: Engine = "compiled"
    half: Literal[0, 1] | None = None

    def __post_init__(self) -> None:
        if not self.bands:
            raise InvalidInput("bands", "none", "at least one band")
        check_ranges(self)
        check_speeds("speed_bounds_mps", self.speed_bounds_mps)
        for end in self.window_s:
            WINDOW_S.check("window_s", end)

    def steps(self, of: Unknown) -> Steps:
        """Limits of an image of speed or attenuation."""
        if of == "attenuation":
            return LOSS_STEPS
        return Steps(self.speed_bounds_mps, 2.0, 12.0)

    def measure(self, of: Unknown) -> Misfit:
        """The misfit that is minimised for speed or attenuation."""
        return correlation if of == "speed" else least_squares

    def program(self, of: Unknown) -> str:
        """This misfit as a program of devices, see ``wave.emissions.Observed``."""
        return "correlation" if of == "speed" else "least_squares"

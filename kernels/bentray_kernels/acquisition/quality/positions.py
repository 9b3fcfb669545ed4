"""Wrong element positions: water times that deviate equally in both directions."""

import math
from collections.abc import Iterator

import numpy as np

from ...arrays import Floats
from ..dataset import Dataset
from ..noise import robust_deviation
from .finding import Finding
from .water_line import WaterLine

# Largest accepted deviation, wavelengths. Noise-free and simulated pulses have a fiftieth.
LARGEST_OFF = 0.05

# Fewest pairs with times in both directions.
MIN_PAIRS = 20


def find_displaced(dataset: Dataset, strongest_s: Floats, line: WaterLine) -> Iterator[Finding]:
    """Find water times that deviate from the element positions by more than their noise.

    A position error or delay of an element is the same in emission and reception; noise is not. So half the
    sum of both directions contains both, half the difference only noise.

    Args:
        dataset: of one slice, channels in their places, with a centre frequency.
        strongest_s: (ntx, nrx), times of the water maxima; NaN where there is none.
        line: through them.
    """
    distance = dataset.distance_m()
    off = np.where(distance > 0.25 * distance.max(), strongest_s - distance / line.speed_mps, np.nan)
    once = dataset.tx[:, None] < dataset.rx
    there, back = off[once], dataset.geometry.reverses(off)[once]
    both = np.isfinite(there + back)
    if both.sum() < MIN_PAIRS:
        return
    alike, noise = (robust_deviation(0.5 * (there + sign * back)[both]) for sign in (1.0, -1.0))
    apart = math.sqrt(max(alike**2 - noise**2, 0.0)) * dataset.water_speed_mps
    allowed = LARGEST_OFF * dataset.water_speed_mps / dataset.frequency_hz
    if apart <= allowed:
        return
    yield Finding(
        "element positions",
        f"water times {1e3 * apart:.2g} mm from those of the positions, equally in both directions: "
        "positions or delays need calibration",
        f"within {1e3 * allowed:.2g} mm, a twentieth of a wavelength",
        "reported",
        value=apart,
        unit="m",
    )

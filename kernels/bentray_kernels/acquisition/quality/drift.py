"""Water that warms or cools during a scan: the slope of times over distance changes with the emission."""

from collections.abc import Iterator

import numpy as np

from ...arrays import Floats
from ..dataset import Dataset
from ..noise import robust_deviation
from ..robust_line import robust_line
from .finding import Finding

DRIFT = "water temperature drift"

# Smallest change that is reported, m/s (0.2 °C), and in standard deviations.
MIN_MPS, CERTAIN = 0.6, 5.0

# Change of the speed with the temperature at 20 °C, m/s per degree.
MPS_PER_DEGREE = 2.9

# Fewest chords of an emission, fewest emissions, and least spread of their distances, as a part of all.
MIN_CHORDS, MIN_EMISSIONS, MIN_SPREAD = 5, 12, 0.05


def find_drift(dataset: Dataset, residual_s: Floats) -> Iterator[Finding]:
    """Find a change of the water speed from the first to the last emission.

    Args:
        dataset: of one slice; its emissions are in the order of recording.
        residual_s: (ntx, nrx), s: times in water minus those of one speed; NaN where unknown.
    """
    distance = dataset.distance_m()
    emissions, slopes = [], []
    for e, row in enumerate(residual_s):
        finite = np.isfinite(row)
        if finite.sum() < MIN_CHORDS or np.std(distance[e][finite]) < MIN_SPREAD * distance.max():
            continue
        emissions.append(float(e))
        slopes.append(robust_line(distance[e][finite], row[finite])[0])
    if len(emissions) < MIN_EMISSIONS:
        return
    order, slope = np.array(emissions), np.array(slopes)
    each, start = robust_line(order, slope)
    whole = (len(dataset.tx) - 1) * dataset.water_speed_mps**2
    sigma = robust_deviation(slope - each * order - start) / (np.std(order) * np.sqrt(order.size)) * whole
    change = -each * whole
    if abs(change) <= max(MIN_MPS, CERTAIN * sigma):
        return
    warmer = "warms" if change > 0.0 else "cools"
    yield Finding(
        DRIFT,
        f"the water {warmer} by {abs(change) / MPS_PER_DEGREE:.1f} °C "
        f"({abs(change):.1f} ± {sigma:.1f} m/s) from the first to the last emission",
        f"within {MIN_MPS:g} m/s; speeds are uncertain by half of the change",
        "reported",
        value=float(change),
        unit="m/s",
    )

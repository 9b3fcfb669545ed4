"""Corrections that the numbers of a scan suggest: units of times and lengths, frequency, order."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.plausibility import USUAL_M, WrongArrangement, check_arrangement

TIME_UNITS: Mapping[str, float] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
POSITION_UNITS: Mapping[str, float] = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6}

# Usual widths of arrays, m, from a ring for small animals to a tank.
WIDTHS_M = (0.03, 1.0)
# Largest differences over the travel time through the water: of a breast, where 0.8 to 3 % were found, and
# less than of any object, about the noise of picks.
# Absolute times in another unit are rejected at upload; differences that are too small look like water.
USUAL_SHARE, LEAST_SHARE = 1e-2, 1e-4
# A stated frequency further from that of the traces is doubted.
FREQUENCY_RATIO = 3.0


@dataclass(frozen=True)
class Proposal:
    """A correction that the numbers of a scan suggest, as ``Correction`` has it.

    Attributes:
        what: ``times``, ``positions``, ``frequency`` or ``arrangement``.
        unit: of the original file; empty for a frequency.
        read_as: unit in which it was read.
        frequency_hz: of the traces; None for units.
        arrangement: the fault in the order of the elements; None otherwise.
        reason: in words.
    """

    what: str
    reason: str
    unit: str = ""
    read_as: str = ""
    frequency_hz: float | None = None
    arrangement: str | None = None


def propose(dataset: Dataset, measured_hz: float | None) -> list[Proposal]:
    """Corrections that the numbers of a scan suggest; empty for a usual scan.

    Args:
        dataset: the scan, without traces.
        measured_hz: centre frequency of its traces; None without traces.
    """
    proposals = [
        _positions(dataset),
        _times(dataset),
        _frequency(dataset, measured_hz),
        _arrangement(dataset),
    ]
    return [proposal for proposal in proposals if proposal is not None]


def _positions(dataset: Dataset) -> Proposal | None:
    width = float(np.ptp(dataset.element_position_m, axis=0).max())
    if WIDTHS_M[0] <= width <= WIDTHS_M[1]:
        return None
    pairs = {("m", "cm"): 1e2, ("cm", "mm"): 10.0, ("mm", "cm"): 0.1, ("cm", "m"): 1e-2}
    unit, read_as = min(pairs, key=lambda pair: abs(math.log(pairs[pair] * width / USUAL_M)))
    factor = pairs[unit, read_as]
    reason = f"The array is {1e3 * width:.4g} mm wide; {1e3 * factor * width:.4g} mm are usual"
    return Proposal("positions", reason, unit, read_as)


def _times(dataset: Dataset) -> Proposal | None:
    if dataset.delta_tof_s is None or dataset.tof_s is not None:
        return None
    sizes = np.abs(dataset.delta_tof_s[np.isfinite(dataset.delta_tof_s)])
    largest = float(np.percentile(sizes, 95.0)) if sizes.size else 0.0
    longest = float(np.ptp(dataset.element_position_m, axis=0).max()) / dataset.water_speed_mps
    if not 0.0 < largest < LEAST_SHARE * longest:
        return None
    pairs = {("ms", "us"): 1e3, ("s", "us"): 1e6, ("s", "ns"): 1e9}
    unit, read_as = min(
        pairs, key=lambda pair: abs(math.log(pairs[pair] * largest / (USUAL_SHARE * longest)))
    )
    reason = (
        f"The differences of the travel times are {1e9 * largest:.3g} ns, "
        f"{1e6 * largest / longest:.2g} millionths of the time through the water"
    )
    return Proposal("times", reason, unit, read_as)


def _arrangement(dataset: Dataset) -> Proposal | None:
    try:
        if dataset.picked:
            check_arrangement(dataset)
    except WrongArrangement as error:
        if error.proposal is not None:
            return Proposal("arrangement", f"Found {error.value}", arrangement=error.proposal.name)
    return None


def _frequency(dataset: Dataset, measured_hz: float | None) -> Proposal | None:
    stated = dataset.center_frequency_hz
    if stated is None or measured_hz is None:
        return None
    if max(stated / measured_hz, measured_hz / stated) <= FREQUENCY_RATIO:
        return None
    rounded = float(f"{measured_hz:.2g}")
    reason = f"The pulses in the traces are at about {1e-3 * rounded:g} kHz, {1e-3 * stated:g} kHz are stated"
    return Proposal("frequency", reason, frequency_hz=rounded)

"""Shape of the array: its angular coverage, and the checks that it excludes."""

import math
from collections.abc import Iterable, Iterator

import numpy as np

from ...errors import InvalidInput
from ..angular_coverage import angular_coverage
from ..dataset import Dataset
from ..reference.water_chords import chord_offset
from .contradictions import CYCLES
from .elements import CLOCK, DISPLACED
from .finding import Finding
from .shadow import SCATTERER
from .time_zero import MIN_PAIRS, OBJECT, OUTSIDE

COVERAGE = "angular coverage"

# Elements whose heights differ by less than this, m, are in one plane.
LEVEL_M = 1e-5


def find_limited_angle(dataset: Dataset) -> Iterator[Finding]:
    """Find an array whose paths do not cross the object in every direction.

    Args:
        dataset: the scan, of one slice or several; with its travel times, if there are any.
    """
    position = dataset.element_position_m
    if position.shape[1] == 3 and np.ptp(position[:, 2]) < LEVEL_M:
        position = position[:, :2]
    used = dataset.tx[:, None] != dataset.rx
    valid = np.isfinite(dataset.differential_tof()) if dataset.picked else dataset.valid
    if valid is not None:
        used &= valid.any(axis=0) if valid.ndim == 3 else valid
    emission, reception = np.nonzero(used)
    elements = position[np.union1d(dataset.tx, dataset.rx)]
    accepted = "elements around the object, and paths through it in every direction"
    try:
        start, end = position[dataset.tx[emission]], position[dataset.rx[reception]]
        coverage = angular_coverage(elements, start, end)
    except InvalidInput as error:
        yield Finding(COVERAGE, str(error.value), accepted, "reported", value=math.nan)
        return
    if coverage is None or not coverage.limited:
        return
    message, unit = str(coverage).removesuffix("."), "of the directions"
    yield Finding(COVERAGE, message, accepted, "reported", value=coverage.visible, unit=unit)


def inapplicable(dataset: Dataset, checked: Iterable[str]) -> dict[str, str]:
    """Reasons why some checks do not apply to a scan or its array, by their names.

    Args:
        dataset: the scan.
        checked: names of checks.
    """
    reasons: dict[str, str] = {}
    if dataset.element_position_m.shape[1] == 3:
        reasons |= dict.fromkeys((CLOCK, DISPLACED, SCATTERER), "only for elements in a plane")
    if np.intersect1d(dataset.tx, dataset.rx).size < 2:
        both = "no elements both emit and receive"
        reasons |= {"element positions": both, "reciprocity": both}
    if (chord_offset(dataset) >= OUTSIDE).sum() < MIN_PAIRS:
        reasons[OBJECT] = "too few paths pass far from the middle of the array"
    if dataset.center_frequency_hz is None:
        reasons[CYCLES] = "the scan states no centre frequency"
    return {name: reasons[name] for name in checked if name in reasons}

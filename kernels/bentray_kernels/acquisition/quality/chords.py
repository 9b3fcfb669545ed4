"""Checks of a scan without a water shot, by the chords that miss the object."""

import numpy as np

from ...arrays import Flags, Floats
from ...errors import InvalidInput
from ..dataset import Dataset
from ..reference.water_chords import WaterChords, chord_offset, find_water_chords
from .correction import apply, exchange_order
from .drift import find_drift
from .elements import CLOCK, find_element_errors
from .finding import Finding
from .measures import Measures
from .order import ORDER, find_wrong_order
from .shadow import find_scatterer
from .swapped import find_swapped

# Chords as far from the axis as all but this part of those found in water are taken to miss the object.
INNERMOST = 2.0

# Iterations of the median over emissions and over receptions.
POLISHED = 4


def examine_chords(dataset: Dataset, measures: Measures) -> tuple[list[Finding], WaterChords]:
    """Findings in the chords through water, and these chords, with faults corrected.

    Args:
        dataset: of one slice, with a centre frequency; its traces are not read.
        measures: of the traces of the object.

    Raises:
        InvalidInput: where too few chords pass through water.
    """
    strongest = measures.unclipped_s
    if mismatch := find_wrong_order(dataset, strongest):
        raise InvalidInput(ORDER, mismatch[0].found, mismatch[0].accepted)
    chords = find_water_chords(dataset, strongest)
    findings = list(find_swapped(dataset, strongest, _expected(dataset, chords)))
    if findings:
        for finding in findings:
            order, axis = exchange_order(dataset, finding)
            strongest = np.take(strongest, order, axis=axis)
        dataset = apply(dataset, findings)
        chords = find_water_chords(dataset, strongest)
    late = strongest - _expected(dataset, chords)
    errors = list(find_element_errors(dataset, late))
    findings += errors
    emission, reception = np.zeros(len(dataset.tx)), np.zeros(len(dataset.rx))
    for finding in errors:
        if finding.check == CLOCK:
            sent = finding.role == "emission"
            of_role = np.isin(dataset.tx if sent else dataset.rx, finding.elements)
            (emission if sent else reception)[of_role] += finding.value
    if emission.any() or reception.any():
        right = strongest - emission[:, None] - reception
        chords = find_water_chords(dataset, right).with_delays(emission, reception)
        late = right - _expected(dataset, chords)
    findings += find_drift(dataset, late)
    findings += find_scatterer(dataset, _log_ratio(dataset, measures))
    return findings, chords


def _expected(dataset: Dataset, chords: WaterChords) -> Floats:
    """Times of the maxima of chords that miss the object, (ntx, nrx), s; NaN for the others."""
    offset = chord_offset(dataset)
    outside: Flags = offset >= np.percentile(offset[chords.pairs], INNERMOST)
    distance = dataset.distance_m()
    outside &= distance >= distance[chords.pairs].min()
    return np.where(outside, chords.arrival_s(distance), np.nan)


def _log_ratio(dataset: Dataset, measures: Measures) -> Floats:
    """Logarithm of the amplitude over what emitter, receiver and distance explain; NaN without a trace."""
    distance = dataset.distance_m()
    usable = np.isfinite(measures.peak) & (measures.peak > 0.0) & (distance > 0.0)
    if dataset.valid is not None:
        usable &= dataset.valid
    ratio = np.where(usable, np.log(np.where(usable, measures.peak * np.sqrt(distance), 1.0)), np.nan)
    for _ in range(POLISHED):
        for axis in (0, 1):
            measured = usable.any(axis=axis)
            middle = np.zeros(measured.size)
            middle[measured] = np.nanmedian(ratio[:, measured] if axis == 0 else ratio[measured], axis=axis)
            ratio = ratio - (middle if axis == 0 else middle[:, None])
    return ratio

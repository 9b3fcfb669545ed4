"""The finding that a scan has no water shot, and what was estimated in its place."""

from ..dataset import Dataset
from ..reference.chord_pulses import ChordPulses, read_pulses
from ..reference.reference_shot import ReferenceShot, chord_signs, estimate_reference
from ..reference.water_chords import WaterChords
from .chords import examine_chords
from .correction import apply, pairs_of
from .finding import Finding
from .measures import Measures
from .polarity import find_inverted
from .sampling import sampling
from .water_speed import find_water_speed

WATER_SHOT = "water shot"


def estimate_water(dataset: Dataset, measures: Measures) -> tuple[list[Finding], ReferenceShot]:
    """The water shot of a slice, and the findings in the chords that it is estimated from.

    Args:
        dataset: of one slice with traces of the object, sampling rate and centre frequency.
        measures: of these traces.

    Raises:
        InvalidInput: where too few chords pass through water.
    """
    findings, chords = examine_chords(dataset, measures)
    dataset = apply(dataset, findings)
    pulses = read_pulses(dataset, range(len(dataset.tx)), chords)
    estimated, reference = estimate_from_pulses(dataset, chords, pulses)
    return [*findings, *estimated], reference


def estimate_from_pulses(
    dataset: Dataset, chords: WaterChords, pulses: ChordPulses, *, examine: bool = True
) -> tuple[list[Finding], ReferenceShot]:
    """The water shot of a slice from the pulses of its chords, and findings in polarity and water speed.

    Args:
        dataset: of one slice, with the findings in its chords applied; its traces are not read.
        chords: through water.
        pulses: of these.
        examine: whether polarity and water speed are examined.

    Raises:
        InvalidInput: where too few chords pass through water.
    """
    findings: list[Finding] = []
    if examine:
        findings = list(find_inverted(dataset, chord_signs(dataset, chords, pulses)))
    for finding in findings:
        pulses = pulses.inverted(pairs_of(dataset, finding))
    reference = estimate_reference(dataset, chords, pulses)
    findings.append(find_estimated_water(dataset, reference))
    if examine:
        fitted = reference.speed_mps, reference.speed_sigma_mps
        speed = find_water_speed(dataset, *fitted)
        findings += [*speed, *sampling(apply(dataset, speed), *fitted)]
    return findings, reference


def find_estimated_water(dataset: Dataset, reference: ReferenceShot) -> Finding:
    """Water properties estimated from the chords that miss the object, beside what the file states."""
    message = (
        f"none; from {reference.chords} chords that miss the object: water of {reference.speed_mps:.1f} m/s "
        f"({'assumed' if dataset.water_temperature_assumed else 'stated'}: {dataset.water_speed_mps:.1f}), "
        f"arrivals {1e6 * reference.delay_s:.3g} µs late"
    )
    return Finding(
        WATER_SHOT, message, "a scan without the object", "reported", value=reference.speed_mps, unit="m/s"
    )

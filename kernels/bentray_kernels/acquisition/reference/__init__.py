"""The water shot of a scan that has none, estimated from the chords that miss the object."""

from .reference_shot import (
    ChordPulses,
    ReferenceShot,
    chords_of_emission,
    estimate_reference,
    read_pulses,
    reference_of,
)
from .water_chords import WaterChords, chord_offset, find_water_chords

__all__ = [
    "ChordPulses",
    "ReferenceShot",
    "WaterChords",
    "chord_offset",
    "chords_of_emission",
    "estimate_reference",
    "find_water_chords",
    "read_pulses",
    "reference_of",
]

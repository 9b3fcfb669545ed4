"""The water shot of a scan that has none, estimated from the chords that miss the object."""

from .chord_pulses import ChordPulses, chords_of_emission, read_pulses
from .reference_shot import ReferenceShot, chord_signs, estimate_reference
from .water_chords import WaterChords, chord_offset, find_water_chords

__all__ = [
    "ChordPulses",
    "ReferenceShot",
    "WaterChords",
    "chord_offset",
    "chord_signs",
    "chords_of_emission",
    "estimate_reference",
    "find_water_chords",
    "read_pulses",
]

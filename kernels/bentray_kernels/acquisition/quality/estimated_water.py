"""The finding that a scan has no water shot, and what was estimated in its place."""

from __future__ import annotations

from ..dataset import Dataset
from ..reference import ReferenceShot
from .finding import Finding

WATER_SHOT = "water shot"


def find_estimated_water(dataset: Dataset, reference: ReferenceShot) -> Finding:
    """What was estimated from the chords that miss the object, beside what the file states."""
    found = (
        f"none; from {reference.chords} chords that miss the object: water of {reference.speed_mps:.1f} m/s "
        f"(stated: {dataset.water_speed_mps:.1f}), arrivals {1e6 * reference.delay_s:.3g} µs late"
    )
    return Finding(
        WATER_SHOT, found, "a scan without the object", "reported", value=reference.speed_mps, unit="m/s"
    )

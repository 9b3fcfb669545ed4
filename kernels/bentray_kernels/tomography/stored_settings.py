"""Settings as earlier versions stored them, in jobs and result files, read as those of today."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .settings import Settings

# Settings that are gone: whatever their value, today's have nothing in their place.
GONE = ("huber_s", "wave_misfit", "wave_variation")
# Values that are gone, by setting, and what stands in for them.
INSTEAD = {"rays": {"adjoint": "curved"}, "amplitudes": {"centroid": "spectrum"}}


def from_stored(values: Mapping[str, Any]) -> Settings:
    """The settings of a stored record.

    Args:
        values: by name, as ``json.loads`` gives them.

    Raises:
        TypeError: for a name that no version had.
        InvalidInput: for a value that is not accepted.
    """
    given: dict[str, Any] = {name: value for name, value in values.items() if name not in GONE}
    for name, instead in INSTEAD.items():
        if name in given:
            given[name] = instead.get(given[name], given[name])
    # JSON has lists where the record has tuples.
    given = {name: tuple(v) if isinstance(v, list) else v for name, v in given.items()}
    return Settings(**given)

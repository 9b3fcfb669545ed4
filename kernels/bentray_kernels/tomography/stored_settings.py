"""Settings as stored in jobs and result files, also by earlier versions, read as those of today."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from .settings import Settings

# Earlier versions stored one flat record; these names changed since.
RENAMED = MappingProxyType(
    {
        "sweeps": "iterations",
        "straight_sweeps": "straight_iterations",
        "axial_room_nodes": "axial_margin_nodes",
        "huber_spreads": "huber_scale",
        "wave_bands": "bands",
        "wave_emitters": "emitters",
        "wave_minutes": "minutes",
    }
)
# Settings without a successor.
REMOVED = ("huber_s", "speed_update", "wave_misfit", "wave_variation")
# Removed values, by setting, and what replaces them.
INSTEAD = {"rays": {"adjoint": "curved"}, "amplitudes": {"centroid": "spectrum"}}
# Where no value was stored.
EARLIER_DEFAULTS = MappingProxyType({"method": "sart", "nodes": 128, "decomposition": "slices"})
# Where 0 meant what None means now.
ZERO_IS_NONE = ("emitters", "minutes", "stop_rms_s")


def from_stored(values: Mapping[str, Any], numerics: Mapping[str, Any] | None = None) -> Settings:
    """The settings of a stored record.

    Args:
        values: as ``json.loads`` gives ``Settings.to_dict``, or the flat record of earlier versions.
        numerics: numerical parameters of a result, as ``json.loads`` gives them.

    Raises:
        TypeError: for a name that no version had.
        InvalidInput: for a value that is not accepted.
    """
    current: dict[str, Any] = {}
    flat = not any(isinstance(value, Mapping) for value in values.values())
    for name, value in values.items():
        if isinstance(value, Mapping):
            inner = {name if leaf == "enabled" else leaf: one for leaf, one in value.items()}
            current |= {leaf: _plain(one) for leaf, one in inner.items()}
        elif name not in REMOVED:
            instead = INSTEAD.get(name, {})
            current[RENAMED.get(name, name)] = _plain(instead.get(value, value) if instead else value)
    if flat:
        current = {**EARLIER_DEFAULTS, **current}
        current |= {name: None for name in ZERO_IS_NONE if current.get(name) == 0}
        if values.get("speed_update") != "data-driven":
            current.pop("speed_range_mps", None)
        if current.get("method") == "waveform":
            # Only ``auto`` had a budget.
            current["minutes"] = None
        if current.get("minutes") is None and current.get("bands") == 4:
            current["bands"] = None
    return Settings.of(**current, **(numerics or {}))


def _plain(value: Any) -> Any:
    """A tuple for a list, which is all that JSON has for it."""
    return tuple(value) if isinstance(value, list) else value

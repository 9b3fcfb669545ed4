"""Settings as stored in jobs and result files, also by earlier versions, read as those of today."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from ..errors import InvalidInput
from .settings import Settings

# Settings that earlier versions had, and what holds or helps instead.
WITHDRAWN = MappingProxyType(
    {
        "seed": "no such setting: the random order of the emitters is always the same",
        "smoothing_nodes": "no such setting: updates are smoothed over one node; choose iterations",
        "penalty": "no such setting: total variation is used; choose gauss_newton.penalty_strength",
        "edge_mps": "no such setting: method auto tries sharp edges by itself; choose "
        "gauss_newton.penalty_strength",
        "attenuation_solver": "no such setting: all rays are solved at once; choose "
        "gauss_newton.penalty_strength",
        "focusing": "no such setting: choose attenuation.amplitudes spectrum, which focusing does not change",
        "delays": "no such setting: for delays in water, choose speed_bounds_mps close around its speed",
        "pair_angle_deg": "no such setting: pairs of up to 90 degrees are summed",
        "coherence_factor": "no such setting: the coherence factor is always applied",
        "gain": "no such setting: amplitudes are not compensated",
        "sweeps": "iterations, which replaces it",
        "wave_minutes": "minutes, which replaces it",
        "speed_update": "no such setting: the wave front is tracked in the image as it is",
        "relaxation": "no such setting: updates of SART are relaxed by 0.1; choose iterations",
        "speed_range_mps": "no such setting: choose speed_bounds_mps, which the image stays within",
        "sart": "no such record: its settings are automatic; choose iterations and speed_bounds_mps",
        "pixel_m": "no such setting: pixels of an eighth of the wavelength, at most 2048 along a side",
    }
)
# Parameters that are not even internal any more, with the one value that is left.
FIXED = MappingProxyType(
    {
        "pair_angle_deg": 90.0,
        "coherence_factor": True,
        "gain": "none",
        "axial_margin_nodes": None,
        "straight_iterations": 0,
        "front_smoothing_nodes": 0.0,
        "relaxation_decay": 1.0,
        "guided_rounds": 0,
    }
)


def from_stored(values: Mapping[str, Any], numerics: Mapping[str, Any] | None = None) -> Settings:
    """The settings of a stored record.

    Args:
        values: as ``json.loads`` gives ``Settings.to_dict``.
        numerics: numerical parameters of a result, as ``json.loads`` gives them.

    Raises:
        TypeError: for a name that no version had.
        InvalidInput: for a value that is not accepted, and for one that no version computes any more.
    """
    current: dict[str, Any] = {}
    for name, value in values.items():
        inner = value if isinstance(value, Mapping) else {name: value}
        current |= {name if leaf == "enabled" else leaf: _plain(value) for leaf, value in inner.items()}
    current |= {name: _plain(value) for name, value in (numerics or {}).items()}
    for name, left in FIXED.items():
        if (value := current.pop(name, left)) != left:
            raise InvalidInput(name, value, f"{left}: {WITHDRAWN.get(name, 'it was removed')}")
    return Settings.from_values(**current)


def _plain(value: Any) -> Any:
    """A tuple for a list, which is all that JSON has for it."""
    return tuple(value) if isinstance(value, list) else value

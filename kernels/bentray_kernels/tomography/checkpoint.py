"""Checkpoint format: the state of a task graph as JSON and arrays, and back, bit for bit."""

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..task_graph import Checkpoint
from .attenuation import Losses
from .gauss_newton import gauss_newton_step
from .reconstruction_graph import ReconstructionCheckpoint
from .result import Iteration
from .sart import sart_step
from .uncertainty.ray_uncertainty import Uncertainty

# Records in checkpoints of a reconstruction, by name; ``waveform`` adds its own.
TYPES: Mapping[str, type] = MappingProxyType(
    {
        kind.__name__: kind
        for kind in (
            ReconstructionCheckpoint,
            sart_step.State,
            sart_step.BlockCheckpoint,
            gauss_newton_step.Iterate,
            gauss_newton_step.Measured,
            Iteration,
            Losses,
            Uncertainty,
        )
    }
)

# Names in files of fields that were renamed, by record.
STORED: Mapping[str, Mapping[str, str]] = {
    "State": {"iteration": "sweep"},
    "Measured": {"iteration": "sweep"},
}

Arrays = list[NDArray[Any]]


def pack(checkpoint: Checkpoint) -> tuple[Any, Arrays]:
    """A checkpoint as a value for ``json.dumps``, and the arrays that it refers to by number."""
    arrays: Arrays = []
    return _pack(checkpoint, arrays), arrays


def unpack(tree: Any, arrays: Sequence[NDArray[Any]], types: Mapping[str, type] = TYPES) -> Checkpoint:
    """The checkpoint again.

    Args:
        tree, arrays: from ``pack``.
        types: records that may be in it, by name.

    Raises:
        KeyError, TypeError, IndexError: for anything that ``pack`` cannot return.
    """
    checkpoint = _unpack(tree, arrays, types)
    if not isinstance(checkpoint, Checkpoint):
        raise TypeError(f"the state of a task graph, not {type(checkpoint).__name__}")
    return checkpoint


def _pack(value: Any, arrays: Arrays) -> Any:
    if is_dataclass(value):
        inner = {name: _pack(getattr(value, own), arrays) for name, own in _names(type(value)).items()}
        return {"of": type(value).__name__, "fields": inner}
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {"array": len(arrays) - 1}
    if isinstance(value, tuple):
        return [_pack(item, arrays) for item in value]
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise TypeError(f"{type(value).__name__} in a checkpoint")


def _unpack(tree: Any, arrays: Sequence[NDArray[Any]], types: Mapping[str, type]) -> Any:
    if isinstance(tree, list):
        return tuple(_unpack(item, arrays, types) for item in tree)
    if isinstance(tree, dict):
        if "array" in tree:
            return arrays[tree["array"]]
        names = _names(types[tree["of"]])
        inner = {names[name]: _unpack(item, arrays, types) for name, item in tree["fields"].items()}
        return types[tree["of"]](**inner)
    return tree


def _names(kind: Any) -> dict[str, str]:
    """Names of the fields of a record, by their names in files."""
    renamed = STORED.get(kind.__name__, {})
    return {renamed.get(field.name, field.name): field.name for field in fields(kind)}

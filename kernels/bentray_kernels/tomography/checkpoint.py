"""A chain's state as JSON and arrays, and back to the bit: what a checkpoint holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .gauss_newton import gauss_newton_step
from .result import Sweep
from .sart import sart_step
from .task_chains import ChainState, Standing

# Records that states are made of, by name. What goes on from a finished image, as ``wave``, adds its own.
TYPES: Mapping[str, type] = MappingProxyType(
    {
        kind.__name__: kind
        for kind in (
            ChainState,
            sart_step.State,
            gauss_newton_step.Iterate,
            gauss_newton_step.Measured,
            Sweep,
        )
    }
)

Arrays = list[NDArray[Any]]


def packed(state: Standing) -> tuple[Any, Arrays]:
    """What ``json.dumps`` takes, and the arrays that it refers to by number."""
    arrays: Arrays = []
    return _pack(state, arrays), arrays


def unpacked(tree: Any, arrays: Sequence[NDArray[Any]], types: Mapping[str, type] = TYPES) -> Standing:
    """The state again.

    Args:
        tree, arrays: as ``packed`` gave them.
        types: of the records that may be in it, by name.

    Raises:
        KeyError, TypeError, IndexError: for what ``packed`` never gave.
    """
    state = _unpack(tree, arrays, types)
    if not isinstance(state, Standing):
        raise TypeError(f"the state of a chain, not {type(state).__name__}")
    return state


def _pack(value: Any, arrays: Arrays) -> Any:
    if is_dataclass(value):
        inner = {field.name: _pack(getattr(value, field.name), arrays) for field in fields(value)}
        return {"of": type(value).__name__, "fields": inner}
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {"array": len(arrays) - 1}
    if isinstance(value, tuple):
        return [_pack(part, arrays) for part in value]
    if value is None or isinstance(value, bool | int | float):
        return value
    raise TypeError(f"a state has no {type(value).__name__}")


def _unpack(tree: Any, arrays: Sequence[NDArray[Any]], types: Mapping[str, type]) -> Any:
    if isinstance(tree, list):
        return tuple(_unpack(part, arrays, types) for part in tree)
    if isinstance(tree, dict):
        if "array" in tree:
            return arrays[tree["array"]]
        inner = {name: _unpack(part, arrays, types) for name, part in tree["fields"].items()}
        return types[tree["of"]](**inner)
    return tree

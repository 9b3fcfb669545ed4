"""A chain's state as JSON and arrays, and back to the bit: what a checkpoint holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import gauss_newton, sart
from .chains import ChainState
from .result import Sweep

TYPES: Mapping[str, type] = MappingProxyType(
    {
        kind.__name__: kind
        for kind in (ChainState, sart.State, gauss_newton.Iterate, gauss_newton.Measured, Sweep)
    }
)

Arrays = list[NDArray[Any]]


def packed(state: ChainState) -> tuple[Any, Arrays]:
    """What ``json.dumps`` takes, and the arrays that it refers to by number."""
    arrays: Arrays = []
    return _pack(state, arrays), arrays


def unpacked(tree: Any, arrays: Sequence[NDArray[Any]]) -> ChainState:
    """The state again.

    Raises:
        KeyError, TypeError, IndexError: for what ``packed`` never gave.
    """
    state = _unpack(tree, arrays)
    if not isinstance(state, ChainState):
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


def _unpack(tree: Any, arrays: Sequence[NDArray[Any]]) -> Any:
    if isinstance(tree, list):
        return tuple(_unpack(part, arrays) for part in tree)
    if isinstance(tree, dict):
        if "array" in tree:
            return arrays[tree["array"]]
        return TYPES[tree["of"]](**{name: _unpack(part, arrays) for name, part in tree["fields"].items()})
    return tree

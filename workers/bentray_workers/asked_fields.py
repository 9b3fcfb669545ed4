"""Fields of what is asked for: described once for every door, and held against choices and limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any

from bentray_kernels.errors import InvalidInput

# Of a side of a picture, and of the square of it in rays.
MOST_PIXELS = 4096
MOST_RAYS = MOST_PIXELS**2


def asked(default: Any, description: str) -> Any:
    """A field; its description is what OpenAPI and the options of the command say."""
    return field(default=default, metadata={"description": description})


def check(
    given: Any, choices: Mapping[str, Sequence[str]], within: Mapping[str, tuple[float, float]]
) -> None:
    """Hold fields against what they may be.

    Args:
        given: has the fields.
        choices: the words that a field may be.
        within: the least and greatest number that a field may be.

    Raises:
        InvalidInput: naming the first field that is wrong.
    """
    for name, words in choices.items():
        if getattr(given, name) not in words:
            raise InvalidInput(name, repr(getattr(given, name)), "one of " + ", ".join(words))
    for name, (low, high) in within.items():
        # NaN is between nothing.
        if not low <= getattr(given, name) <= high:
            raise InvalidInput(name, getattr(given, name), f"a number from {low:g} to {high:g}")

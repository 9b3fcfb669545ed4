"""Fields of what is asked for: described once for every door, and held against choices and limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any

from bentray_kernels.errors import InvalidInput
from bentray_kernels.ranges import Range, check_ranges, ranged

# Of a side of a picture, and of the square of it in rays.
MOST_PIXELS = 4096
MOST_RAYS = MOST_PIXELS**2


def asked(
    default: Any, description: str, within: Range | None = None, schema: Mapping[str, Any] | None = None
) -> Any:
    """A field; its description is what OpenAPI and the options of the command say.

    Args:
        default: of the field.
        description: of the field.
        within: the range of its numbers, checked by ``check``.
        schema: where there is no such range, what JSON Schema can say of what the field may be beside its
            type; the class itself checks it.
    """
    if within is None:
        return field(default=default, metadata={"description": description, "json_schema_extra": schema})
    return ranged(default, within, description=description)


def check(given: Any, choices: Mapping[str, Sequence[str]]) -> None:
    """Hold fields against what they may be.

    Args:
        given: has the fields.
        choices: the words that a field may be.

    Raises:
        InvalidInput: naming the first field that is wrong.
    """
    for name, words in choices.items():
        if getattr(given, name) not in words:
            raise InvalidInput(name, repr(getattr(given, name)), "one of " + ", ".join(words))
    check_ranges(given)

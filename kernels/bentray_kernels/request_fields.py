"""Fields of a request: description, range and choices, declared once and checked in every interface."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, fields
from functools import cache
from typing import Any, Literal, get_args, get_origin, get_type_hints

from bentray_kernels.errors import InvalidInput
from bentray_kernels.ranges import Range, check_ranges, ranged

# Of a side of a picture, and of the square of it in rays.
MAX_PIXELS = 4096
MAX_RAYS = MAX_PIXELS**2


def setting(
    default: Any,
    description: str,
    within: Range | None = None,
    schema: Mapping[str, Any] | None = None,
    *,
    unset: str = "",
    label: str = "",
    unit: str = "",
    words: Mapping[str, str] | None = None,
) -> Any:
    """A field of a dataclass with the metadata for OpenAPI, the command line, the web page and the documents.

    Args:
        default: of the field.
        description: of the field.
        within: the range of its numbers, checked by ``check``.
        schema: without a range, what JSON Schema states beside the type; the class itself checks it.
        unset: what holds where the value is None.
        label: short name on a form.
        unit: of its numbers, on a form.
        words: accepted values on a form, where they are not as in the file.
    """
    shown = {"x-label": label, "x-unit": unit, "x-unset": unset, "x-words": dict(words or {})}
    extra = {
        **((schema or {}) if within is None else within.schema),
        **{name: value for name, value in shown.items() if value},
    }
    more = {"description": description, "unset": unset, "json_schema_extra": extra or None}
    return field(default=default, metadata=more) if within is None else ranged(default, within, **more)


@cache
def choices_of(kind: type) -> Mapping[str, tuple[str, ...]]:
    """The accepted words by field: those of its ``Literal`` type, or ``enum`` of its schema."""
    hints = get_type_hints(kind)
    choices = {}
    for one in fields(kind):
        parts = [hints[one.name], *get_args(hints[one.name])]
        words = next((get_args(part) for part in parts if get_origin(part) is Literal), ())
        words = words or (one.metadata.get("json_schema_extra") or {}).get("enum", ())
        if words:
            choices[one.name] = tuple(words)
    return choices


def check(record: Any, choices: Mapping[str, Sequence[str]] | None = None, place: str = "") -> None:
    """Check the fields of a request against their choices and ranges.

    Args:
        record: a dataclass.
        choices: accepted words by field; None: those of ``choices_of``, and None where it is the default.
        place: the name of the record in the one that holds it, for the error.

    Raises:
        InvalidInput: naming the first field that is wrong.
    """
    before = f"{place}." if place else ""
    kind: Any = type(record)
    optional = {one.name for one in fields(record) if one.default is None} if choices is None else set()
    for name, words in (choices_of(kind) if choices is None else choices).items():
        value = getattr(record, name)
        if value not in words and not (value is None and name in optional):
            raise InvalidInput(before + name, repr(value), "one of " + ", ".join(words))
    check_ranges(record, before)

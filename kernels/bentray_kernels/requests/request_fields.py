"""Fields of a request: description, range and choices, declared once and checked in every interface."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import field, fields, is_dataclass
from functools import cache
from typing import Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.ranges import Range, check_ranges, ranged

# Of a side of a picture, and of the square of it in rays.
MAX_PIXELS = 4096
MAX_RAYS = MAX_PIXELS**2

# When a field has an effect: alternatives, in each of which other fields have one of some values or lie in a
# range. Names of what only the scan decides are those of ``FACTS``.
Use = Mapping[str, "tuple[Any, ...] | Range"]
Uses = tuple[Use, ...]
ALWAYS: Uses = ({},)
ABOVE_ZERO = Range(0.0, math.inf, above=True)
# Under this key a field's metadata holds its ``Uses``, and the values that ask for nothing.
USED_WHEN, NEUTRAL = "used_when", "neutral"
# What a scan may have, in words.
FACTS = {
    "scan_amplitudes": "the scan has amplitudes",
    "scan_traces": "the scan has traces of object and water",
    "scan_picks": "travel times are picked from traces",
}


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
    used_when: Uses = ALWAYS,
    neutral: tuple[Any, ...] = (),
    basic: bool = False,
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
        used_when: when the field has an effect, see ``Uses``.
        neutral: values that ask for nothing, as the default does.
        basic: whether a form shows it before the others.
    """
    shown: dict[str, Any] = {"x-label": label, "x-unit": unit, "x-unset": unset, "x-words": dict(words or {})}
    shown |= {"x-basic": basic}
    if used_when != ALWAYS:
        shown["x-used-when"] = [
            {name: getattr(accepted, "schema", accepted) for name, accepted in use.items()}
            for use in used_when
        ]
    extra = {
        **((schema or {}) if within is None else within.schema),
        **{name: value for name, value in shown.items() if value},
    }
    more: dict[str, Any] = {"description": description, "unset": unset, "json_schema_extra": extra or None}
    more |= {USED_WHEN: used_when, NEUTRAL: neutral}
    return field(default=default, metadata=more) if within is None else ranged(default, within, **more)


@cache
def choices_of(kind: type) -> Mapping[str, tuple[str, ...]]:
    """The accepted words by field: those of its ``Literal`` type, or ``enum`` of its schema."""
    hints = get_type_hints(kind)
    choices = {}
    for entry in fields(kind):
        types = [hints[entry.name], *get_args(hints[entry.name])]
        words = next((get_args(hint) for hint in types if get_origin(hint) is Literal), ())
        words = words or (entry.metadata.get("json_schema_extra") or {}).get("enum", ())
        if words:
            choices[entry.name] = tuple(words)
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
    optional = {entry.name for entry in fields(record) if entry.default is None} if choices is None else set()
    for name, words in (choices_of(kind) if choices is None else choices).items():
        value = getattr(record, name)
        if value not in words and not (value is None and name in optional):
            raise InvalidInput(before + name, repr(value), "one of " + ", ".join(words))
    check_ranges(record, before)


class Declared(NamedTuple):
    """A field of a request where its record is part of another one.

    Attributes:
        place: its name with those of the records that hold it, for errors.
        default: its value where nothing is requested.
        uses: when it has an effect.
        neutral: other values that ask for nothing.
    """

    place: str
    default: Any
    uses: Uses
    neutral: tuple[Any, ...]


def declared(kind: Any, path: str = "") -> dict[str, Declared]:
    """The fields of a dataclass, and of the dataclasses in it, by their own names.

    A field ``enabled`` has the name of its record: ``reflection`` is ``reflection.enabled``.
    """
    by_name: dict[str, Declared] = {}
    for entry in fields(kind):
        if is_dataclass(entry.default):
            by_name |= declared(entry.default, f"{path}{entry.name}.")
        else:
            name = path.rstrip(".") if entry.name == "enabled" and path else entry.name
            conditions = entry.metadata.get(USED_WHEN, ALWAYS), entry.metadata.get(NEUTRAL, ())
            by_name[name] = Declared(path + entry.name, entry.default, *conditions)
    return by_name


def value_at(record: Any, path: str) -> Any:
    """The value of a field by its place, such as ``picking.picker``."""
    for name in path.split("."):
        record = getattr(record, name)
    return record


def unused(
    record: Any, facts: Mapping[str, bool] | None = None, requested: Any = None
) -> dict[str, tuple[Any, str]]:
    """Fields that request something but have no effect: by place, the default and what they lack.

    Args:
        record: a dataclass of settings, as it is used.
        facts: see ``FACTS``; what is not known may hold.
        requested: the same as requested, where some fields were decided since.
    """
    settings = declared(type(record))
    values: dict[str, Any] = {name: value_at(record, setting.place) for name, setting in settings.items()}
    values |= facts or {}
    idle = {}
    for path, default, uses, neutral in settings.values():
        value = value_at(record if requested is None else requested, path)
        lacking = [_lacking(use, values, settings) for use in uses]
        if value not in (default, *neutral) and all(lacking):
            # What needs more than another alternative says nothing new.
            shortest = [terms for terms in lacking if not any(other < terms for other in lacking)]
            idle[path] = default, ", or ".join(" and ".join(sorted(terms)) for terms in shortest)
    return idle


def check_used(record: Any) -> Any:
    """The record, if each of its fields that requests something may have an effect beside the others.

    Raises:
        InvalidInput: naming the first field that has none, and when it would.
    """
    for path, (default, lacking) in unused(record).items():
        value = value_at(record, path)
        shown = repr(value) if isinstance(value, str) else value
        raise InvalidInput(path, shown, f"{_word(default)}, unless {lacking}")
    return record


def effective_when(kind: Any) -> dict[str, str]:
    """When fields of a dataclass have an effect, in words, by place; without those that always have one."""
    settings = declared(kind)
    return {
        setting.place: ", or ".join(
            " and ".join(_in_words(*term, settings) for term in use.items()) for use in setting.uses
        )
        for setting in settings.values()
        if all(setting.uses)
    }


def _lacking(use: Use, values: Mapping[str, Any], settings: Mapping[str, Declared]) -> set[str]:
    """The conditions of an alternative that do not hold, as ``method is sart or auto``; empty if all may."""
    return {
        _in_words(name, accepted, settings)
        for name, accepted in use.items()
        if name in values and not _meets(values[name], accepted)
    }


def _meets(value: Any, accepted: tuple[Any, ...] | Range) -> bool:
    if isinstance(accepted, Range):
        return value is not None and accepted.holds(value)
    return value in accepted


def _in_words(name: str, accepted: tuple[Any, ...] | Range, settings: Mapping[str, Declared]) -> str:
    if name in FACTS:
        return FACTS[name]
    if accepted == ABOVE_ZERO:
        return f"{settings[name].place} is above 0"
    *others, last = [accepted.words] if isinstance(accepted, Range) else map(_word, accepted)
    return (
        f"{settings[name].place} is {', '.join(others)} or {last}"
        if others
        else f"{settings[name].place} is {last}"
    )


def _word(value: Any) -> str:
    """A value as JSON has it, a word without quotes."""
    return value if isinstance(value, str) else json.dumps(value)

"""Settings of a request: every name known, every value of its type, errors with the name of the setting."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from pydantic import TypeAdapter, ValidationError

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography.settings import NUMERICAL, PLACES, Settings
from bentray_kernels.tomography.stored_settings import REMOVED, RENAMED

ADAPTER: TypeAdapter[Settings] = TypeAdapter(Settings)


def check_setting_names(settings: Any, kind: type[Any] = Settings, place: str = "") -> Any:
    """Return ``settings`` if all its names are fields of a dataclass; other types than a mapping pass.

    Args:
        settings: the JSON value.
        kind: the dataclass; its fields may be dataclasses.
        place: before the names in the error.

    Raises:
        InvalidInput: naming the first unknown field, and what to use instead.
    """
    known = {field.name: field.default for field in fields(kind)}
    for name, value in settings.items() if isinstance(settings, Mapping) else ():
        inner = is_dataclass(known.get(name))
        if name not in known or (inner and isinstance(value, bool)):
            instead = _replacement(name) if kind is Settings else ""
            accepted = instead or "a known setting: " + ", ".join(known)
            raise InvalidInput(place + str(name), repr(value)[:80], accepted)
        if inner:
            check_setting_names(value, type(known[name]), f"{place}{name}.")
    return settings


def _replacement(name: str) -> str:
    """What replaces a setting of the flat record of earlier versions; empty for a name that it had not."""
    if name in REMOVED:
        return "sart.speed_range_mps alone" if name == "speed_update" else "no such setting: it was removed"
    new = RENAMED.get(name, name)
    if new in NUMERICAL:
        budget = ", from minutes" if new in ("bands", "emitters") else ""
        return f"no such setting: it is decided automatically{budget}"
    return f"{PLACES[new]}, which replaces it" if new in PLACES else ""


def nested(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values by the names of ``PLACES`` as the nested record has them."""
    settings: dict[str, Any] = {}
    for name, value in values.items():
        record, _, leaf = PLACES[name].rpartition(".")
        (settings.setdefault(record, {}) if record else settings)[leaf] = value
    return settings


def settings_of(values: Mapping[str, Any]) -> Settings:
    """The settings of a nested record of numbers and words as JSON has them; the rest takes its default.

    Raises:
        InvalidInput: naming the first setting that is unknown or wrong, its value and what is accepted.
    """
    try:
        return ADAPTER.validate_python(check_setting_names(dict(values)))
    except ValidationError as error:
        # Loads FastAPI, which nothing else here needs.
        from .web.errors import fault_of

        fault = fault_of(error.errors()[0])
        raise InvalidInput(fault.field, fault.found, fault.accepted) from None

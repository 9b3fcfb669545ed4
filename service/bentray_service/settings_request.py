"""Settings of a request: every name known, every value of its type, errors with the name of the setting."""

from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from difflib import get_close_matches
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError, field_validator

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.request_fields import check_used
from bentray_kernels.tomography.settings import NUMERICAL, PLACES, Settings
from bentray_kernels.tomography.stored_settings import WITHDRAWN

Record = TypeVar("Record")
# The record of a reconstruction and those in it.
RECORDS = {Settings, *(type(field.default) for field in fields(Settings) if is_dataclass(field.default))}
# Description of the settings of a request.
DEFAULTS = "Omitted settings take their defaults."
# Each kind of record is analysed once.
_ADAPTERS: dict[type, TypeAdapter[Any]] = {}


def check_setting_names(settings: Any, kind: type[Any] = Settings, place: str = "") -> Any:
    """Return ``settings`` if all its names are fields of a dataclass; other types than a mapping pass.

    Args:
        settings: the JSON value.
        kind: the dataclass; its fields may be dataclasses.
        place: before the names in the error.

    Raises:
        InvalidInput: naming the first unknown field, and what to use instead or the name spelt most like it.
    """
    known = {field.name: field.default for field in fields(kind)}
    for name, value in settings.items() if isinstance(settings, Mapping) else ():
        inner = is_dataclass(known.get(name))
        if name not in known or (inner and isinstance(value, bool)):
            instead = _replacement(name) if kind in RECORDS else ""
            others = PLACES.values() if kind is Settings else (f"{place}{one}" for one in known)
            accepted = instead or known_setting(place + str(name), others, ", ".join(known))
            raise InvalidInput(place + str(name), repr(value)[:80], accepted)
        if inner:
            check_setting_names(value, type(known[name]), f"{place}{name}.")
    return settings


class SettingsRequest(BaseModel):
    """A request with ``settings``, a dataclass."""

    model_config = ConfigDict(extra="forbid")

    @field_validator("settings", mode="before", check_fields=False)
    @classmethod
    def check_names(cls, settings: Any) -> Any:
        """Reject unknown settings by name, with the accepted ones."""
        kind: Any = cls.model_fields["settings"].annotation
        return check_setting_names(settings, kind)

    @field_validator("settings", mode="after", check_fields=False)
    @classmethod
    def check_effect(cls, settings: Any) -> Any:
        """Reject settings that have no effect beside the others, by name."""
        return check_used(settings)


def _replacement(name: str) -> str:
    """Replacement of a setting of the flat record of earlier versions; empty for an unknown name."""
    if name in WITHDRAWN:
        return WITHDRAWN[name]
    if name in NUMERICAL:
        budget = ", from minutes" if name in ("bands", "emitters") else ""
        return f"no such setting: it is decided automatically{budget}"
    return f"{PLACES[name]}, which replaces it" if name in PLACES else ""


def known_setting(name: str, names: Iterable[str], known: str) -> str:
    """The accepted names in words, first the one that is spelt most like an unknown name.

    Args:
        name: the unknown one.
        names: what it may be meant for.
        known: the list to show.
    """
    # A person writes the last part of ``picking.picker`` alone.
    by_spelling = {spelt: one for one in names for spelt in (one.rpartition(".")[2], one)}
    near = get_close_matches(name, by_spelling, 1)
    meant = f"{by_spelling[near[0]]} is spelt like it; " if near else ""
    return f"{meant}a known setting: {known}"


def nested(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values by the names of ``PLACES`` as the nested record has them.

    Raises:
        InvalidInput: naming the first unknown name, and what to use instead or the name spelt most like it.
    """
    settings: dict[str, Any] = {}
    for name, value in values.items():
        if name not in PLACES:
            accepted = _replacement(name) or known_setting(name, PLACES, ", ".join(PLACES))
            raise InvalidInput(name, repr(value)[:80], accepted)
        record, _, leaf = PLACES[name].rpartition(".")
        (settings.setdefault(record, {}) if record else settings)[leaf] = value
    return settings


def record_of(kind: type[Record], values: Mapping[str, Any]) -> Record:
    """A dataclass of settings from numbers and words as JSON has them; the rest takes its default.

    Raises:
        InvalidInput: naming the first setting that is unknown, wrong, or without effect beside the others,
            its value and what is accepted.
    """
    if kind not in _ADAPTERS:
        _ADAPTERS[kind] = TypeAdapter(kind)
    try:
        named = check_setting_names(dict(values), kind)
        record: Record = check_used(_ADAPTERS[kind].validate_python(named))
    except ValidationError as error:
        # Loads FastAPI, which nothing else here needs.
        from .web.errors import fault_of

        fault = fault_of(error.errors()[0])
        raise InvalidInput(fault.field, fault.found, fault.accepted) from None
    return record


def plain_numbers(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values with Python's numbers in place of those of NumPy, which JSON does not know."""
    return {name: value.item() if isinstance(value, np.generic) else value for name, value in values.items()}

"""Settings as people write them: every name known, every value of its kind."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from pydantic import TypeAdapter, ValidationError

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography.settings import Settings

ADAPTER: TypeAdapter[Settings] = TypeAdapter(Settings)


def known_only(given: Any, of: type[Any] = Settings) -> Any:
    """``given`` if it names no field that the dataclass ``of`` has not; what is no mapping is left to others.

    Raises:
        InvalidInput: with the list of those that exist.
    """
    known = [field.name for field in fields(of)]
    for name in given if isinstance(given, Mapping) else ():
        if name not in known:
            raise InvalidInput(name, repr(given[name])[:80], "a known setting: " + ", ".join(known))
    return given


def settings_of(given: Mapping[str, Any]) -> Settings:
    """The settings by name, numbers and words as JSON has them; what is left out takes its default.

    Raises:
        InvalidInput: naming the first setting that is unknown or wrong, its value and what is accepted.
    """
    try:
        return ADAPTER.validate_python(known_only(dict(given)))
    except ValidationError as error:
        # Loads FastAPI, which nothing else here needs.
        from .web.errors import fault_of

        fault = fault_of(error.errors()[0])
        raise InvalidInput(fault.field, fault.found, fault.accepted) from None

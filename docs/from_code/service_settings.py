"""Table of the environment variables of the service."""

from __future__ import annotations

from typing import Any

from annotated_types import Ge, Gt, Le
from pydantic_core import PydanticUndefined

from bentray_service.settings import ServiceSettings

from .tables import table

LIMITS = {Ge: ("ge", "≥"), Gt: ("gt", ">"), Le: ("le", "≤")}


def settings_table() -> str:
    """Variable, default, limits and meaning of each field of `ServiceSettings`."""
    rows = [_row(name, field) for name, field in ServiceSettings.model_fields.items()]
    return table(("variable", "default", "accepted", "meaning"), rows)


def _row(name: str, field: Any) -> tuple[str, str, str, str]:
    aliases = getattr(field.validation_alias, "choices", [f"BENTRAY_{name}"])
    default = "none" if field.default in (None, PydanticUndefined) else f"`{field.default}`"
    return f"`{aliases[-1].upper()}`", default, _accepted(field), field.description or ""


def _accepted(field: Any) -> str:
    values = getattr(field.annotation, "__args__", ())
    if values and all(isinstance(value, str) for value in values):
        return ", ".join(f"`{value}`" for value in values)
    limits = (
        f"{sign} {getattr(limit, name)}"
        for limit in field.metadata
        for kind, (name, sign) in LIMITS.items()
        if isinstance(limit, kind)
    )
    return ", ".join(limits)

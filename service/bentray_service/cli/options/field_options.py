"""The options of a geometry field: its settings and its view."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from bentray_kernels.requests.request_fields import check_used
from bentray_workers.rendering.field_settings import FieldSettings
from bentray_workers.rendering.field_view import FieldView

from .option_tables import options_of, with_options

# By field, in the order of the help.
SETTINGS, VIEW = options_of(FieldSettings, {}, {}), options_of(FieldView, {"positions_m": "position_m"}, {})
OPTIONS = {**SETTINGS, **VIEW}


@dataclass(frozen=True)
class FieldOptions:
    """Values of the given options, by field."""

    given: dict[str, Any]

    def settings(self) -> FieldSettings:
        """The settings; raises InvalidInput naming the first invalid one."""
        return FieldSettings(**{name: value for name, value in self.given.items() if name in SETTINGS})

    def view(self) -> FieldView:
        """The view; raises InvalidInput naming the first invalid field."""
        given: dict[str, Any] = {name: value for name, value in self.given.items() if name in VIEW}
        if "positions_m" in given:
            given["positions_m"] = tuple(given["positions_m"])
        view: FieldView = check_used(FieldView(**given))
        return view


with_field_options = with_options(OPTIONS, FieldOptions)

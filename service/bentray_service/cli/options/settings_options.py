"""The options of a reconstruction, one for each setting, generated from the metadata of the settings."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, get_type_hints

from bentray_kernels.requests.request_fields import choices_of
from bentray_kernels.tomography.settings import PLACES, Settings
from bentray_kernels.tomography.stored_settings import WITHDRAWN

from .option_tables import Command, Option, flag_of, option_of, with_options


@dataclass(frozen=True)
class SettingsOptions:
    """The settings of a command line: values of the options that were given, by the names of ``PLACES``."""

    options: dict[str, Any]


def _options() -> dict[str, Option]:
    found = {}
    for name, place in PLACES.items():
        record, _, leaf = place.rpartition(".")
        kind: Any = type(getattr(Settings(), record)) if record else Settings
        (field,) = (one for one in fields(kind) if one.name == leaf)
        found[name] = option_of(field, get_type_hints(kind)[leaf], choices_of(kind).get(leaf, ()), name)
    return found


def _withdrawn() -> dict[str, Option]:
    """Options of earlier versions, hidden: each ends in the line that says what replaced it."""
    switches = ("focusing", "coherence_factor")
    flags = {name: flag_of(name) for name in WITHDRAWN}
    return {
        name: Option(f"{flag}/--no-{flag[2:]}", bool, "", "", hidden=True)
        if name in switches
        else Option(flag, str, "", "", hidden=True)
        for name, flag in flags.items()
    }


# By the names of ``PLACES``, in the order of the help.
OPTIONS = _options()


def with_settings_options(command: Command) -> Command:
    """The command with one CLI option per setting in place of its parameter ``options``."""
    return with_options({**OPTIONS, **_withdrawn()}, SettingsOptions)(command)


def settings_from(options: SettingsOptions) -> Settings:
    """The settings of a command line; an option that is not given takes its default.

    Raises:
        InvalidInput: naming the setting, its value and what is accepted.
    """
    from ...settings_request import nested, settings_of

    return settings_of(nested(options.options))

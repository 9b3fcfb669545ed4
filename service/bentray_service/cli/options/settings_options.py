"""The options of a reconstruction, one for each setting, generated from the metadata of the settings."""

from __future__ import annotations

from dataclasses import Field, dataclass, fields
from typing import Any, get_args, get_type_hints

from bentray_kernels.ranges import RANGE
from bentray_kernels.request_fields import choices_of
from bentray_kernels.tomography.settings import PLACES, Settings

from .option_tables import Command, Option, with_options

# Left off the name of an option: ``--side`` is in metres, as its help says.
UNITS = ("_mps", "_m", "_nodes", "_deg", "_c")


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
        found[name] = _option(name, field, get_type_hints(kind)[leaf], choices_of(kind).get(leaf, ()))
    return found


def _option(name: str, field: Field[Any], hint: Any, choices: tuple[str, ...]) -> Option:
    unit = next((unit for unit in UNITS if name.endswith(unit)), "")
    flag = "--" + name.removesuffix(unit).replace("_", "-")
    kind, metavar, text = hint, None, field.metadata["description"]
    if field.default is None:
        (kind,) = (part for part in get_args(hint) if part is not type(None))
    if choices:
        kind = str
        if not all(word in text for word in choices):
            text = f"{text} One of: {', '.join(choices)}."
    elif kind is bool:
        flag = f"{flag}/--no-{flag[2:]}"
    elif get_args(kind):
        metavar = "LOW HIGH"
    elif RANGE in field.metadata:
        words = field.metadata[RANGE].words
        # Not capitalize(), which turns °C and MHz into °c and mhz.
        text = f"{text} {words[:1].upper()}{words[1:]}."
    return Option(flag, kind, default_of(field), text, metavar)


def default_of(field: Field[Any]) -> str:
    """The default of a setting in words."""
    if field.default is None:
        return str(field.metadata["unset"])
    if isinstance(field.default, bool):
        return "yes" if field.default else "no"
    return " ".join(map(str, field.default)) if isinstance(field.default, tuple) else str(field.default)


# By the names of ``PLACES``, in the order of the help.
OPTIONS = _options()


def with_settings_options(command: Command) -> Command:
    """The command with one CLI option per setting in place of its parameter ``options``."""
    return with_options(OPTIONS, SettingsOptions)(command)


def settings_from(options: SettingsOptions) -> Settings:
    """The settings of a command line; an option that is not given takes its default.

    Raises:
        InvalidInput: naming the setting, its value and what is accepted.
    """
    from ...settings_request import nested, settings_of

    return settings_of(nested(options.options))

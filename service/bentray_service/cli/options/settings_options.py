"""The options of a reconstruction, one for each setting, generated from the metadata of the settings."""

from __future__ import annotations

from typing import Any

from bentray_kernels.tomography.settings import PLACES, Settings
from bentray_kernels.tomography.stored_settings import WITHDRAWN

from .option_tables import Option, flag_of, options_of, with_options


def _options() -> dict[str, Option]:
    options = {}
    for name, place in PLACES.items():
        record, _, leaf = place.rpartition(".")
        kind: Any = type(getattr(Settings(), record)) if record else Settings
        options[name] = options_of(kind, {leaf: name})[leaf]
    return options


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

# The command with one CLI option per setting in place of its parameter ``options``.
with_settings_options = with_options({**OPTIONS, **_withdrawn()})


def settings_from(options: dict[str, Any]) -> Settings:
    """The settings of a command line; an option that is not given takes its default.

    Args:
        options: values of the options that were given, by the names of ``PLACES``.

    Raises:
        InvalidInput: naming the setting, its value and what is accepted.
    """
    from ...settings_request import nested, record_of

    return record_of(Settings, nested(options))

"""The settings of a reconstruction as a table, from the metadata of the settings themselves."""

from collections.abc import Iterator
from dataclasses import fields

from bentray_kernels.requests.ranges import RANGE
from bentray_kernels.requests.request_fields import choices_of, effective_when
from bentray_kernels.tomography.settings import PLACES, Settings
from bentray_service.cli.options.option_tables import SETTINGS_OPTIONS, default_of

from .tables import table


def reconstruction_settings() -> str:
    """Place in the nested record, default, accepted values, option and meaning of each setting."""
    return table(("setting", "default", "accepted", "option", "meaning"), _rows())


def _rows() -> Iterator[tuple[str, str, str, str, str]]:
    effective = effective_when(Settings)
    for name, place in PLACES.items():
        record, _, leaf = place.rpartition(".")
        kind = type(getattr(Settings(), record)) if record else Settings
        (field,) = (one for one in fields(kind) if one.name == leaf)
        words = ", ".join(f"`{word}`" for word in choices_of(kind).get(leaf, ()))
        within = field.metadata.get(RANGE)
        accepted = words or (within.words if within else "")
        meaning = field.metadata["description"]
        if place in effective:
            meaning += f" Has an effect if {effective[place]}."
        default = default_of(field) if field.default is None else f"`{default_of(field)}`"
        yield f"`{place}`", default, accepted, f"`{SETTINGS_OPTIONS[name].name}`", meaning

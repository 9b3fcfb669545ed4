"""Options of a command in place of one parameter, generated from tables or from the fields of requests."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import Field, dataclass, fields
from functools import wraps
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import typer

from bentray_kernels.requests.ranges import RANGE
from bentray_kernels.requests.request_fields import choices_of
from bentray_kernels.tomography.settings import PLACES, Settings
from bentray_kernels.tomography.stored_settings import WITHDRAWN

Command = Callable[..., None]

# Left off the name of an option: ``--side`` is in metres, as its help says.
UNITS = ("_mps", "_m", "_nodes", "_deg", "_c", "_hz")
# More do not fit a line of 80 columns beside the name of the option.
LONGEST_CHOICES = 64


@dataclass(frozen=True)
class Option:
    """An option that sets one field; ``default`` is what the help says, and never given to the command."""

    name: str
    kind: Any
    default: str
    help: str
    metavar: str | None = None
    hidden: bool = False

    def parameter(self, setting: str) -> inspect.Parameter:
        """Convert to a parameter of a Typer command, None where it is not given."""
        shown: Any = self.default or False
        how = typer.Option(
            self.name, show_default=shown, help=self.help, metavar=self.metavar, hidden=self.hidden
        )
        return inspect.Parameter(
            setting, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=Annotated[self.kind | None, how]
        )


def with_options(options: Mapping[str, Option], replaced: str = "options") -> Callable[[Command], Command]:
    """A decorator that replaces one parameter of a command by one CLI option per field.

    Args:
        options: by field.
        replaced: name of the parameter, a dictionary of the values of the given options by field.
    """

    def decorate(command: Command) -> Command:
        @wraps(command)
        def run(**given: Any) -> None:
            # Typer passes an empty list for a repeatable option that is not given.
            values = {name: value for name in options if (value := given.pop(name)) not in (None, [])}
            command(**{replaced: values}, **given)

        parameters: list[inspect.Parameter] = []
        for parameter in inspect.signature(command, eval_str=True).parameters.values():
            if parameter.name == replaced:
                parameters += [option.parameter(name) for name, option in options.items()]
            else:
                parameters.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY))
        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        return run

    return decorate


def options_of(
    record: Any, names: Mapping[str, str] | None = None, more: Mapping[str, str] | None = None
) -> dict[str, Option]:
    """One option for each field with a ``description``, by field; its help is that, with choices or range.

    Args:
        record: a dataclass.
        names: of options that are not called as their field, without hyphens at their beginning.
        more: further sentences of the help, by field.
    """
    hints, choices = get_type_hints(record), choices_of(record)
    return {
        field.name: _option_of(
            field,
            hints[field.name],
            choices.get(field.name, ()),
            (names or {}).get(field.name, field.name),
            (more or {}).get(field.name, ""),
        )
        for field in fields(record)
        if "description" in field.metadata
    }


def _option_of(field: Field[Any], hint: Any, choices: tuple[str, ...], name: str, more: str) -> Option:
    flag = flag_of(name)
    kind, metavar, text = hint, None, field.metadata["description"]
    if field.default is None:
        (kind,) = (part for part in get_args(hint) if part is not type(None))
    if choices:
        kind, metavar = str, shown_choices(choices)
        if metavar is None and not all(word in text for word in choices):
            text = f"{text} One of: {', '.join(choices)}."
    elif kind is bool:
        flag = f"{flag}/--no-{flag[2:]}"
    elif get_origin(kind) is tuple and get_args(kind)[-1] is ...:
        kind, text = list[get_args(kind)[0]], f"{text} Repeatable."  # type: ignore[misc]
    elif get_args(kind):
        metavar = "LOW HIGH"
    elif RANGE in field.metadata:
        words = field.metadata[RANGE].words
        # Not capitalize(), which turns °C and MHz into °c and mhz.
        text = f"{text} {words[:1].upper()}{words[1:]}."
    return Option(flag, kind, default_of(field), f"{text} {more}".rstrip(), metavar)


def flag_of(name: str) -> str:
    """The option of a field: without the unit, with hyphens."""
    unit = next((unit for unit in UNITS if name.endswith(unit)), "")
    return "--" + name.removesuffix(unit).replace("_", "-")


def shown_choices(choices: tuple[str, ...]) -> str | None:
    """Choices as the help shows them, ``<a|b>``; None if they are too long for a line."""
    shown = f"<{'|'.join(choices)}>"
    return shown if len(shown) <= LONGEST_CHOICES else None


def default_of(field: Field[Any]) -> str:
    """The default of a field in words."""
    if field.default in (None, ()):
        return str(field.metadata["unset"])
    if isinstance(field.default, bool):
        return "yes" if field.default else "no"
    return " ".join(map(str, field.default)) if isinstance(field.default, tuple) else str(field.default)


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
SETTINGS_OPTIONS = _options()

# The command with one CLI option per setting in place of its parameter ``options``.
with_settings_options = with_options({**SETTINGS_OPTIONS, **_withdrawn()})


def settings_from(options: dict[str, Any]) -> Settings:
    """The settings of a command line; an option that is not given takes its default.

    Args:
        options: values of the options that were given, by the names of ``PLACES``.

    Raises:
        InvalidInput: naming the setting, its value and what is accepted.
    """
    from ...settings_request import nested, record_of

    return record_of(Settings, nested(options))

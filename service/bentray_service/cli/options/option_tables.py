"""Options generated from tables: they replace one parameter of a command."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import wraps
from typing import Annotated, Any

import typer

Command = Callable[..., None]


@dataclass(frozen=True)
class Option:
    """An option that sets one field; ``default`` is what the help says, and never given to the command."""

    name: str
    kind: Any
    default: str
    help: str
    metavar: str | None = None

    def parameter(self, setting: str) -> inspect.Parameter:
        """As a parameter of a Typer command, None where it is not given."""
        shown: Any = self.default or False
        how = typer.Option(self.name, show_default=shown, help=self.help, metavar=self.metavar)
        return inspect.Parameter(
            setting, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=Annotated[self.kind | None, how]
        )


def with_options(
    options: Mapping[str, Option], collect: Callable[[dict[str, Any]], Any], replaced: str = "options"
) -> Callable[[Command], Command]:
    """A decorator that replaces one parameter of a command by one CLI option per field.

    Args:
        options: by field.
        collect: converts the values of the CLI options, by field, to the argument.
        replaced: name of the parameter.
    """

    def decorate(command: Command) -> Command:
        @wraps(command)
        def run(**given: Any) -> None:
            # Typer passes an empty list for a repeatable option that is not given.
            values = {name: value for name in options if (value := given.pop(name)) not in (None, [])}
            command(**{replaced: collect(values)}, **given)

        parameters: list[inspect.Parameter] = []
        for parameter in inspect.signature(command, eval_str=True).parameters.values():
            if parameter.name == replaced:
                parameters += [option.parameter(name) for name, option in options.items()]
            else:
                parameters.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY))
        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        return run

    return decorate

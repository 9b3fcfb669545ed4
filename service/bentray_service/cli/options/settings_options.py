"""The options that set a reconstruction, given to every command that starts one."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bentray_kernels.errors import InvalidInput

if TYPE_CHECKING:
    from bentray_kernels.tomography import Settings

Range = tuple[float, float]


@dataclass(frozen=True)
class Option:
    """An option that sets one setting; ``default`` is what the help says, and never given to the command."""

    name: str
    kind: Any
    default: str
    help: str
    metavar: str | None = None

    def parameter(self, setting: str) -> inspect.Parameter:
        """As a parameter of a Typer command, None where it is not given."""
        shown: Any = self.default or False
        how = typer.Option(self.name, show_default=shown, help=self.help, metavar=self.metavar)
        return _parameter(setting, Annotated[self.kind | None, how])


# By setting, in the order of the help.
OPTIONS = {
    "method": Option(
        "--method",
        str,
        "sart",
        "sart: one emitter after another; gauss-newton: all at once, regularised; auto: chosen by held-out "
        "validation; waveform: full-waveform inversion from the image of auto.",
    ),
    "rays": Option(
        "--rays",
        str,
        "curved",
        "curved: corrected for refraction; straight.",
    ),
    "eikonal": Option("--eikonal", str, "deviation", "Eikonal solver for curved rays, e.g. fmm or fsm."),
    "nodes": Option("--nodes", int, "128", "Nodes per side of the image."),
    "side_m": Option("--side", float, "the array and a margin", "Side of the image, m."),
    "sweeps": Option("--sweeps", int, "5", "Iterations over all emitters."),
    "speed_update": Option(
        "--speed-update",
        str,
        "fixed",
        "fixed, or data-driven: stretch the image to --speed-range before solving the Eikonal equation.",
    ),
    "speed_range_mps": Option(
        "--speed-range", Range, "", "Lowest and highest speed in the object, m/s.", "LOW HIGH"
    ),
    "relaxation": Option("--relaxation", float, "0.1", "SART's λ, between 0 and 2."),
    "smoothing_nodes": Option(
        "--smoothing", float, "1.0", "Gaussian on each update of SART, nodes; 0 is none."
    ),
    "seed": Option("--seed", int, "0", "Seed of the random emitter order."),
    "penalty_strength": Option(
        "--penalty-strength", float, "0.3", "Of gauss-newton's penalty, over the misfit; 0 is none."
    ),
    "picker": Option(
        "--picker",
        str,
        "aic",
        "How times are read from raw traces: aic, threshold, energy-ratio, sta-lta, correlation or matched.",
    ),
}
SET = typer.Option(
    "--set", metavar="NAME=VALUE", help="Any setting by name, e.g. coarser_grids=2; repeatable."
)


@dataclass(frozen=True)
class Asked:
    """What a command line says of the settings.

    Attributes:
        options: values of the options that were given, by setting.
        texts: what ``--set`` was given, as NAME=VALUE.
    """

    options: dict[str, Any]
    texts: tuple[str, ...] = ()


def with_settings_options(command: Callable[..., None]) -> Callable[..., None]:
    """The command with the options in place of its parameter ``asked``, which gets what was given."""

    @wraps(command)
    def run(**given: Any) -> None:
        options = {name: value for name in OPTIONS if (value := given.pop(name)) is not None}
        command(asked=Asked(options, tuple(given.pop("texts") or ())), **given)

    parameters: list[inspect.Parameter] = []
    for parameter in inspect.signature(command, eval_str=True).parameters.values():
        if parameter.name == "asked":
            parameters += [option.parameter(setting) for setting, option in OPTIONS.items()]
            parameters.append(_parameter("texts", Annotated[list[str] | None, SET]))
        else:
            parameters.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY))
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return run


def settings_from(asked: Asked) -> Settings:
    """The settings that a command line asks for; what it leaves out takes its default.

    Raises:
        InvalidInput: naming the setting, its value and what is accepted.
    """
    from ...asked_settings import settings_of

    given = dict(asked.options)
    for text in asked.texts:
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise InvalidInput("--set", repr(text), "NAME=VALUE, e.g. coarser_grids=2")
        if name in asked.options:
            raise InvalidInput(name, f"{OPTIONS[name].name} and --set {text}", "one of the two")
        if name in given:
            raise InvalidInput(name, f"two values by --set, the second {value!r}", "one value")
        given[name] = _read(value)
    return settings_of(given)


def _read(text: str) -> Any:
    """As JSON, else as the text it is."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return text


def _parameter(name: str, annotation: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=annotation)

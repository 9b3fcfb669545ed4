"""The options that set a view of a volume as glass, made into parameters of a command."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .settings_options import Option

if TYPE_CHECKING:
    from bentray_workers.rendering.refraction_view import RefractionView

# By field of the view, in the order of the help. The defaults are the view's own; a test compares them.
OPTIONS = {
    "iso": Option("--iso", list[float], "the middle of the range", "Rising iso-values; may be repeated."),
    "index": Option("--index", list[float], "1.5", "Refractive index above each iso-value."),
    "outside": Option("--outside", float, "1.0", "Refractive index below the first one."),
    "surroundings": Option(
        "--surroundings", int, "0", "Layer that goes on around: 0 is below the first one."
    ),
    "filter": Option("--filter", str, "bspline3", "central, trilinear, catmull-rom, bspline2 to bspline6."),
    "smoothing": Option(
        "--smoothing", float, "0.0", "Of a B-spline; 10 to 100 takes off the steps of 8 bits."
    ),
    "camera": Option("--camera", str, "orthographic", "orthographic or perspective."),
    "azimuth_deg": Option("--azimuth", float, "30.0", "Of the camera about the z axis, degrees."),
    "elevation_deg": Option("--elevation", float, "20.0", "Of the camera above the x-y plane, degrees."),
    "zoom": Option("--zoom", float, "1.0", "1 shows the whole volume."),
    "backdrop": Option(
        "--backdrop", str, "checkerboard", "checkerboard, picture (a test card), or a picture file."
    ),
    "squares": Option("--squares", int, "16", "Of the checkerboard, across the shorter side."),
    "backdrop_distance": Option("--distance", float, "1.0", "Of the backdrop, in diagonals of the volume."),
    "supersampling": Option(
        "--supersampling", str, "prss", "none, prss (after refraction), real (more rays)."
    ),
    "degree": Option("--degree", int, "1", "Of the supersampling."),
    "fresnel": Option("--fresnel", bool, "False", "Weaken light by what each surface mirrors away."),
    "mode": Option("--mode", str, "refract", "refract, or shaded: the first surface, lit."),
    "width": Option("--width", int, "512", "Pixels."),
    "height": Option("--height", int, "512", "Pixels."),
    "depth": Option("--depth", int, "16", "Most surfaces that a ray may meet."),
}


@dataclass(frozen=True)
class ViewOptions:
    """What a command line says of a view: the values of the options that were given, by field."""

    given: dict[str, Any]

    def view(self) -> tuple[RefractionView, Path | None]:
        """The view, and the picture file of its backdrop if it has one.

        Raises:
            InvalidInput: naming the first field that is wrong.
        """
        from bentray_workers.rendering.refraction_view import CHOICES, RefractionView

        given: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in self.given.items()}
        backdrop, file = given.get("backdrop"), None
        if backdrop is not None and backdrop not in CHOICES["backdrop"]:
            given["backdrop"], file = "picture", Path(backdrop)
        return RefractionView(**given), file


def with_view_options(command: Callable[..., None]) -> Callable[..., None]:
    """The command with the options in place of its parameter ``asked``, an ``ViewOptions``."""

    @wraps(command)
    def run(**given: Any) -> None:
        # Typer gives an empty list for an option that may be repeated and was not given.
        options = {name: value for name in OPTIONS if (value := given.pop(name)) not in (None, [])}
        command(asked=ViewOptions(options), **given)

    parameters: list[inspect.Parameter] = []
    for parameter in inspect.signature(command, eval_str=True).parameters.values():
        if parameter.name == "asked":
            parameters += [option.parameter(name) for name, option in OPTIONS.items()]
        else:
            parameters.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY))
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return run

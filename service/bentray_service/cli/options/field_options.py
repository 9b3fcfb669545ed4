"""The options that say how a geometry field is made and looked at, made into parameters of a command."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import TYPE_CHECKING, Any

from .settings_options import Option

if TYPE_CHECKING:
    from bentray_workers.rendering.field_settings import FieldSettings
    from bentray_workers.rendering.field_view import FieldView

# By field, in the order of the help. The defaults are those of the dataclasses; a test compares them.
SETTINGS = {
    "samples": Option("--samples", int, "24", "Along an edge of the cube, for rays from outside; 4 to 48."),
    "inner_samples": Option("--inner-samples", int, "16", "The same, for rays that leave the surface."),
    "divisions": Option("--divisions", int, "16", "Small cubes along an edge, for points of the surface."),
    "image_size": Option(
        "--image-size", int, "513", "Pixels along a side of the geometry image, 33 to 1025."
    ),
    "image_threshold": Option(
        "--image-threshold", float, "0.0", "Halve the image as long as its rms error is below; 0: never."
    ),
}
VIEW = {
    "scene": Option("--scene", str, "object", "object, mirror-ball, two-mirrors."),
    "mode": Option("--mode", str, "reflect", "reflect, refract, refract-single, self, self-only, diffuse."),
    "lookup": Option("--lookup", str, "accurate", "nearest, linear, accurate, exact (without the field)."),
    "eye": Option("--eye", str, "exact", "The same for rays of the eye."),
    "index": Option("--index", float, "1.5", "Refractive index of glass."),
    "share": Option("--share", float, "0.85", "Of the light, mirrored or refracted."),
    "camera": Option("--camera", str, "perspective", "perspective or orthographic."),
    "azimuth_deg": Option("--azimuth", float, "-60.0", "Of the camera about the vertical, degrees."),
    "elevation_deg": Option("--elevation", float, "15.0", "Of the camera above the horizon, degrees."),
    "zoom": Option("--zoom", float, "1.0", "1 shows the whole scene."),
    "up": Option("--up", str, "z", "Axis of the mesh that is up: z or y."),
    "width": Option("--width", int, "512", "Pixels."),
    "height": Option("--height", int, "512", "Pixels."),
    "rays": Option("--rays", int, "1", "Along each side of a pixel."),
    "depth": Option("--depth", int, "4", "Most surfaces at which a ray goes on."),
}
OPTIONS = {**SETTINGS, **VIEW}


@dataclass(frozen=True)
class FieldOptions:
    """What a command line says of a field: the values of the options that were given, by field."""

    given: dict[str, Any]

    def settings(self) -> FieldSettings:
        """How to make it.

        Raises:
            InvalidInput: naming the first setting that is wrong.
        """
        from bentray_workers.rendering.field_settings import FieldSettings

        return FieldSettings(**{name: value for name, value in self.given.items() if name in SETTINGS})

    def view(self) -> FieldView:
        """How to look at it.

        Raises:
            InvalidInput: naming the first field that is wrong.
        """
        from bentray_workers.rendering.field_view import FieldView

        return FieldView(**{name: value for name, value in self.given.items() if name in VIEW})


def with_field_options(command: Callable[..., None]) -> Callable[..., None]:
    """The command with the options in place of its parameter ``asked``, an ``FieldOptions``."""

    @wraps(command)
    def run(**given: Any) -> None:
        options = {name: value for name in OPTIONS if (value := given.pop(name)) is not None}
        command(asked=FieldOptions(options), **given)

    parameters: list[inspect.Parameter] = []
    for parameter in inspect.signature(command, eval_str=True).parameters.values():
        if parameter.name == "asked":
            parameters += [option.parameter(name) for name, option in OPTIONS.items()]
        else:
            parameters.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY))
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return run

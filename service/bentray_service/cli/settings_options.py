"""The options that set a reconstruction, shared by the commands that start one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from bentray_kernels.tomography import Settings

# An option that is not given stays None and leaves the default to Settings, so that no command has its own.
Method = Annotated[
    str | None,
    typer.Option(
        "--method",
        show_default="sart",
        help="sart: one emitter after the other; gauss-newton: all at once, with a penalty; auto tries both.",
    ),
]
Rays = Annotated[
    str | None,
    typer.Option("--rays", show_default="curved", help="curved follows refraction, straight does not."),
]
Eikonal = Annotated[
    str | None,
    typer.Option(
        "--eikonal", show_default="accurate", help="Wave-front method for curved rays, as fmm or fsm."
    ),
]
Sweeps = Annotated[
    int | None, typer.Option("--sweeps", show_default="5", help="How often every emitter is used.")
]
Relaxation = Annotated[
    float | None, typer.Option("--relaxation", show_default="0.1", help="SART's λ, between 0 and 2.")
]
Nodes = Annotated[
    int | None, typer.Option("--nodes", show_default="128", help="Nodes along a side of the image.")
]
Side = Annotated[
    float | None, typer.Option("--side", show_default="the array and a margin", help="Side of the image, m.")
]
SpeedUpdate = Annotated[
    str | None,
    typer.Option(
        "--speed-update",
        show_default="fixed",
        help="fixed, or data-driven: stretch the image to --speed-range before the wave front is tracked.",
    ),
]
SpeedRange = Annotated[
    tuple[float, float] | None,
    typer.Option("--speed-range", metavar="LOW HIGH", help="Lowest and highest speed in the object, m/s."),
]
Smoothing = Annotated[
    float | None,
    typer.Option(
        "--smoothing", show_default="1.0", help="Gaussian on each emitter's update, nodes; 0 is none."
    ),
]
PenaltyStrength = Annotated[
    float | None,
    typer.Option(
        "--penalty-strength",
        show_default="0.3",
        help="Of gauss-newton's penalty, over the misfit; 0 is none.",
    ),
]
Picker = Annotated[
    str | None,
    typer.Option(
        "--picker", show_default="aic", help="How times are read from raw traces: aic or threshold."
    ),
]
Seed = Annotated[
    int | None, typer.Option("--seed", show_default="0", help="Seed of the random emitter order.")
]


def settings_from(**given: Any) -> Settings:
    """The settings for the options of a command, by the names of ``Settings``; None stands for its default.

    Raises:
        InvalidInput: naming the setting, its value and what is accepted.
    """
    from bentray_kernels.tomography import Settings

    return Settings(**{name: value for name, value in given.items() if value is not None})

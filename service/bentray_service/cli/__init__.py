"""The `bentray` command: a file for each subcommand or a few that belong together, with lazy imports."""

import logging
from collections.abc import Callable
from typing import Annotated, Any

import typer

from . import (
    audit,
    backup,
    bench,
    compare,
    convert,
    demo,
    devices,
    export,
    geometry_field,
    keys,
    projects,
    quality,
    reconstruct,
    render,
    serve,
    simulate,
    submit,
    webhooks,
    worker,
)
from .options.view_options import RepeatedSpacing
from .output.exit_codes import INTERRUPTED, Commands
from .output.terminal import show_warnings_on_one_line

__all__ = ["app", "main"]

app = typer.Typer(
    name="bentray",
    cls=Commands,
    # The tables of rich cut the names of options on a terminal of 80 columns.
    rich_markup_mode=None,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Refraction-corrected ultrasound computed tomography: sound speed, and attenuation (experimental).",
    epilog="Start with: bentray demo. Exit codes: 0 success, 1 failure, 2 invalid input, 3 doubtful result.",
)

# Commands by the panels of the help.
PANELS: dict[str, tuple[Callable[..., Any], ...]] = {
    "Reconstruct": (
        demo.demo,
        reconstruct.reconstruct,
        quality.quality,
        compare.compare,
        reconstruct.reproduce,
        simulate.simulate,
        geometry_field.geometry_field,
    ),
    "Data": (convert.convert, convert.correct, export.export),
    "Service": (serve.serve, worker.worker, submit.submit, export.download),
    "Administration": (
        audit.audit,
        backup.backup,
        backup.restore,
        backup.verify,
        devices.devices,
        bench.bench,
    ),
}
for panel, commands in PANELS.items():
    for command in commands:
        app.command(rich_help_panel=panel)(command)
app.command(cls=RepeatedSpacing, rich_help_panel="Reconstruct")(render.render)
for name, group in {"keys": keys.keys, "projects": projects.projects, "webhooks": webhooks.webhooks}.items():
    app.add_typer(group, name=name, rich_help_panel="Administration")


def _version(requested: bool) -> None:
    if requested:
        from bentray_service import __version__

        typer.echo(f"bentray {__version__}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _start(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None:
    show_warnings_on_one_line()
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def main() -> None:
    """Run the command line of this process."""
    try:
        app()
    except SystemExit as end:
        if end.code == INTERRUPTED:
            # What is still running has nothing more to say.
            logging.disable(logging.CRITICAL)
        raise

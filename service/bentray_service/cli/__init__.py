"""The `bentray` command: one file per subcommand, with lazy imports."""

from __future__ import annotations

import logging
from typing import Annotated

import typer

from . import (
    audit,
    backup,
    bench,
    compare,
    convert,
    correct,
    demo,
    devices,
    download,
    export,
    geometry_field,
    keys,
    projects,
    quality,
    reconstruct,
    render,
    reproduce,
    serve,
    simulate,
    submit,
    verify,
    webhooks,
    worker,
)
from .options.repeated_words import RepeatedSpacing
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

for command in (
    demo.demo,
    serve.serve,
    worker.worker,
    submit.submit,
    download.download,
    reconstruct.reconstruct,
    reproduce.reproduce,
    quality.quality,
    convert.convert,
    correct.correct,
    compare.compare,
    export.export,
    simulate.simulate,
    bench.bench,
    geometry_field.geometry_field,
    devices.devices,
    audit.audit,
    verify.verify,
    backup.backup,
    backup.restore,
):
    app.command()(command)
app.command(cls=RepeatedSpacing)(render.render)
app.add_typer(keys.keys, name="keys")
app.add_typer(projects.projects, name="projects")
app.add_typer(webhooks.webhooks, name="webhooks")


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

"""The `bentray` command: one file a command, each loading what it needs only when it runs."""

from __future__ import annotations

from typing import Annotated

import typer

from . import (
    audit,
    bench,
    convert,
    demo,
    devices,
    download,
    geometry_field,
    keys,
    quality,
    reconstruct,
    render,
    reproduce,
    serve,
    simulate,
    submit,
    verify,
    worker,
)
from .options.repeated_words import RepeatedSpacing
from .output.exit_codes import Commands
from .output.terminal import show_our_warnings_in_a_line

__all__ = ["app", "main"]

app = typer.Typer(
    name="bentray",
    cls=Commands,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Refraction-corrected ultrasound computed tomography: sound-speed and attenuation images.",
    epilog="Begin with: bentray demo. Exit codes: 0 done, 1 the work failed, 2 the input was bad.",
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
    simulate.simulate,
    bench.bench,
    geometry_field.geometry_field,
    devices.devices,
    audit.audit,
    verify.verify,
):
    app.command()(command)
app.command(cls=RepeatedSpacing)(render.render)
app.add_typer(keys.keys, name="keys")


def _version(asked: bool) -> None:
    if asked:
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
    show_our_warnings_in_a_line()
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def main() -> None:
    """Run the command line of this process."""
    app()

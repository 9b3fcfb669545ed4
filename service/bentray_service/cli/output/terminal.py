"""Terminal output: results on stdout, progress and messages on stderr."""

import json
import math
import sys
import warnings
from collections.abc import Collection, Iterable, Sequence
from typing import Annotated, Any, Literal

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from ...interactive.progress_bar import Step as Step
from ...interactive.progress_bar import phase_note as phase_note
from ...interactive.progress_bar import progress_bar as progress_bar
from ...interactive.progress_bar import progress_shown as progress_shown

# Width of tables in files and pipes.
WIDTH = 120

AsJson = Annotated[bool, typer.Option("--json", help="Print the figures as JSON; nothing else is on stdout.")]


def remark(text: str) -> None:
    """Print a message to stderr."""
    sys.stderr.write(text + "\n")
    sys.stderr.flush()


def show_warnings_on_one_line() -> None:
    """Print warnings of Bentray as one-line messages."""
    usual = warnings.showwarning

    def show(message: Any, category: type[Warning], *place: Any, **more: Any) -> None:
        if category.__module__.startswith("bentray_"):
            remark(f"bentray: warning: {message}")
        else:
            usual(message, category, *place, **more)

    warnings.showwarning = show


def print_json(figures: object) -> None:
    """Print JSON to stdout; NaN and infinity become null."""
    sys.stdout.write(json.dumps(without_nan(figures), indent=2, allow_nan=False) + "\n")
    sys.stdout.flush()


def print_result(figures: object, lines: Iterable[str], *, as_json: bool) -> None:
    """Print the figures as JSON, or else the lines."""
    if as_json:
        print_json(figures)
    else:
        print_lines(lines)


def without_nan(value: object) -> object:
    """Replace non-finite numbers by None, in lists and dicts at any depth."""
    if isinstance(value, dict):
        return {key: without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [without_nan(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def print_table(
    title: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[object]],
    numbers: Collection[str] = (),
    bold: str = "",
) -> None:
    """Print a table to stdout; ``numbers`` are right-aligned columns, ``bold`` is one in bold type."""
    table = Table(title=title, title_justify="left")
    for name in columns:
        justify: Literal["left", "right"] = "right" if name in numbers else "left"
        table.add_column(name, justify=justify, overflow="fold", style="bold" if name == bold else "")
    for row in rows:
        table.add_row(*(Text(str(cell)) for cell in row))
    Console(width=None if sys.stdout.isatty() else WIDTH).print(table)


def print_lines(lines: Iterable[str]) -> None:
    """Print lines to stdout without wrapping, so that paths can be copied."""
    sys.stdout.writelines(line + "\n" for line in lines)
    sys.stdout.flush()

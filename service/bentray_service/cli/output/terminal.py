"""What a command shows: figures on stdout; progress and remarks on stderr, progress on a terminal only."""

from __future__ import annotations

import json
import math
import sys
import warnings
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Annotated, Any, Protocol

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

# Columns of a table that goes into a file or a pipe.
WIDTH = 120

AsJson = Annotated[bool, typer.Option("--json", help="Print the figures as JSON; nothing else is on stdout.")]


class Step(Protocol):
    """Moves a progress bar: so many done of so many, with a word beside it."""

    def __call__(self, done: int, total: int, note: str = "") -> None: ...


def remark(text: str) -> None:
    """One line for the person who watches, on stderr."""
    sys.stderr.write(text + "\n")
    sys.stderr.flush()


def show_our_warnings_in_a_line() -> None:
    """From now on a warning of ours is a remark; those of libraries look as Python shows them."""
    usual = warnings.showwarning

    def show(message: Any, category: type[Warning], *place: Any, **more: Any) -> None:
        if category.__module__.startswith("bentray_"):
            remark(f"bentray: warning: {message}")
        else:
            usual(message, category, *place, **more)

    warnings.showwarning = show


def print_json(figures: object) -> None:
    """``figures`` as JSON, the only thing on stdout; NaN and infinity become null, as JSON has neither."""
    sys.stdout.write(json.dumps(without_nan(figures), indent=2, allow_nan=False) + "\n")
    sys.stdout.flush()


def without_nan(value: object) -> object:
    """``value`` with every non-finite number replaced by None, in lists and dicts at any depth."""
    if isinstance(value, dict):
        return {key: without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [without_nan(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def print_table(
    title: str, columns: Sequence[str], rows: Sequence[Sequence[object]], numbers: Collection[str] = ()
) -> None:
    """A table on stdout; the columns named in ``numbers`` are set flush right."""
    table = Table(title=title, title_justify="left")
    for name in columns:
        table.add_column(name, justify="right" if name in numbers else "left", overflow="fold")
    for row in rows:
        table.add_row(*(Text(str(cell)) for cell in row))
    Console(width=None if sys.stdout.isatty() else WIDTH).print(table)


def print_lines(lines: Iterable[str]) -> None:
    """Lines on stdout as they are; paths are never folded, so that they can be copied."""
    sys.stdout.writelines(line + "\n" for line in lines)
    sys.stdout.flush()


def residual_note(rms_s: float | None) -> str:
    """The residual as it stands beside a progress bar; empty before the first sweep has ended."""
    return "" if rms_s is None else f"residual {rms_s * 1e9:.0f} ns"


@contextmanager
def progress_bar(description: str) -> Iterator[Step]:
    """A bar on stderr; call what it yields with (done, total, remark). Nothing is drawn off a terminal."""
    console = Console(stderr=True)
    columns: list[Any] = [
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[remark]}"),
    ]
    with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as bar:
        task = bar.add_task(description, total=None, remark="")

        def step(done: int, total: int, note: str = "") -> None:
            bar.update(task, completed=done, total=total, remark=note)

        yield step

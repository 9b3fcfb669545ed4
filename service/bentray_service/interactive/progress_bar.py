"""A progress bar on a terminal or in a notebook; nothing where nobody watches."""

from __future__ import annotations

import html
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

# Shortest time between two drawings in a notebook, s: each is a message to the browser.
REDRAW_S = 0.2


class Step(Protocol):
    """Updates a progress bar."""

    def __call__(self, done: int, total: int, note: str = "") -> None: ...


@contextmanager
def progress_bar(description: str, *, shown: bool = True) -> Iterator[Step]:
    """Show a progress bar, in the cell of a notebook or on stderr if it is a terminal.

    Args:
        description: beside the bar.
        shown: false: no bar.

    Yields:
        a function to update it.
    """
    notebook = _notebook() if shown else None
    if not shown:
        yield lambda done, total, note="": None
    elif notebook is None:
        with _on_terminal(description) as step:
            yield step
    else:
        with _in_notebook(description, notebook) as step:
            yield step


@contextmanager
def _on_terminal(description: str) -> Iterator[Step]:
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


def _notebook() -> Any | None:
    """``IPython.display`` in the kernel of a notebook, else None; a notebook has loaded it already."""
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    if shell is None or not hasattr(shell, "kernel"):
        return None
    from IPython import display

    return display


@contextmanager
def _in_notebook(description: str, display: Any) -> Iterator[Step]:
    begun = time.perf_counter()
    drawn = begun
    handle = display.display(display.HTML(bar_html(description, 0, 0)), display_id=True)

    def step(done: int, total: int, note: str = "") -> None:
        nonlocal drawn
        now = time.perf_counter()
        if now - drawn >= REDRAW_S:
            drawn = now
            handle.update(display.HTML(bar_html(description, done, total, note)))

    ended = "stopped"
    try:
        yield step
        ended = "done"
    finally:
        seconds = time.perf_counter() - begun
        handle.update(display.HTML(f"{html.escape(description)}: {ended} after {seconds:.1f} s"))


def bar_html(description: str, done: int, total: int, note: str = "") -> str:
    """The bar in HTML; it moves without a value while the total is unknown."""
    value = f' value="{done}" max="{total}"' if total else ""
    count = f"{done}/{total}" if total else ""
    words = " ".join(html.escape(word) for word in (count, note) if word)
    return f"{html.escape(description)} <progress{value}></progress> {words}"

"""A progress bar on a terminal or in a notebook, and lines in a log: no wait is silent."""

from __future__ import annotations

import html
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import TYPE_CHECKING, Any, Protocol

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

if TYPE_CHECKING:
    from bentray_kernels.tomography import result

# Shortest time between two drawings in a notebook, s: each is a message to the browser.
REDRAW_S = 0.2
# Time to the first line of a log and between two lines, s; shorter work has none.
FIRST_LINE_S, LINE_S = 1.5, 2.5


class Step(Protocol):
    """Updates a progress bar."""

    def __call__(self, done: int, total: int, note: str = "") -> None: ...


def progress_bar(description: str, *, shown: bool = True) -> AbstractContextManager[Step]:
    """Show a progress bar in the cell of a notebook or on a terminal, else lines; both are on stderr.

    While this process compiles kernels, their count takes the place of that of the work.

    Args:
        description: beside the bar.
        shown: false: no bar.

    Returns:
        A context manager with a function to update it.
    """
    if not shown:
        return nullcontext(lambda done, total, note="": None)
    if (notebook := _notebook()) is not None:
        return _in_notebook(description, notebook)
    console = Console(stderr=True)
    return _on_terminal(description, console) if console.is_terminal else _in_lines(description)


def phase_note(phase: str, rms_s: float | None = None) -> str:
    """What is done, beside a bar: the phase of a job, or the residual of its last iteration, s."""
    if rms_s is not None and phase in ("", "reconstructing"):
        return f"residual {rms_s * 1e9:.0f} ns"
    return "compiling kernels" if phase == "compiling" else phase


def progress_shown(step: Step) -> Callable[[result.Progress], None]:
    """A function that shows the progress of a computation and its last residual on a bar."""

    def show(now: result.Progress) -> None:
        rms = now.history[-1].residual_rms_s if now.history else None
        step(now.done, now.total, phase_note(now.phase, rms))

    return show


def compilation_note() -> str:
    """The kernels that this process compiles now; empty where it compiles none."""
    # Commands without kernels do not load them.
    compiled = sys.modules.get("bentray_kernels.compilation.compiled")
    counts = getattr(compiled, "compilation", None)
    now = counts and counts()
    return f"compiling kernels {now.done} of {now.total}" if now and now.active else ""


class _Note(ProgressColumn):
    """What is done now, drawn anew several times a second."""

    max_refresh = None

    def render(self, task: Task) -> Text:
        return Text(compilation_note() or task.fields["remark"])


class _TimeLeft(TimeRemainingColumn):
    """The time left, while no kernels are compiled."""

    def render(self, task: Task) -> Text:
        return Text("") if compilation_note() or task.speed is None else super().render(task)


@contextmanager
def _on_terminal(description: str, console: Console) -> Iterator[Step]:
    columns: list[Any] = [
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        _TimeLeft(compact=True),
        _Note(),
    ]
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(description, total=None, remark="")
        last = 0, 0

        def step(done: int, total: int, note: str = "") -> None:
            nonlocal last
            if total != last[1] or done < last[0]:
                # Another stage has its own speed.
                begun = bar.tasks[0].start_time
                bar.reset(task, completed=done)
                bar.tasks[0].total, bar.tasks[0].start_time = total or None, begun
            last = done, total
            bar.update(task, completed=done, remark=note)

        yield step


@contextmanager
def _in_lines(description: str) -> Iterator[Step]:
    begun, ended, latest = time.monotonic(), threading.Event(), (0, 0, "")

    def step(done: int, total: int, note: str = "") -> None:
        nonlocal latest
        latest = done, total, note

    def write() -> None:
        wait = FIRST_LINE_S
        while not ended.wait(wait):
            wait = LINE_S
            sys.stderr.write(line(description, *latest, time.monotonic() - begun) + "\n")
            sys.stderr.flush()

    writing = threading.Thread(target=write, name="progress", daemon=True)
    writing.start()
    try:
        yield step
    finally:
        ended.set()
        writing.join()


def line(description: str, done: int, total: int, note: str, seconds: float) -> str:
    """A line of a log, as ``Reconstructing: 3 of 8, residual 80 ns, 12 s``."""
    count = f"{done} of {total}" if total else ""
    words = [compilation_note()] if compilation_note() else [word for word in (count, note) if word]
    return f"{description}: {', '.join([*words, f'{seconds:.0f} s'])}"


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
            handle.update(
                display.HTML(bar_html(description, done, total, compilation_note() or note, now - begun))
            )

    ended = "stopped"
    try:
        yield step
        ended = "done"
    finally:
        seconds = time.perf_counter() - begun
        handle.update(display.HTML(f"{html.escape(description)}: {ended} after {seconds:.1f} s"))


def bar_html(description: str, done: int, total: int, note: str = "", seconds: float = 0.0) -> str:
    """The bar in HTML with the seconds since its begin; it moves without a value while the total is 0."""
    value = f' value="{done}" max="{total}"' if total else ""
    count = f"{done}/{total}" if total else ""
    words = " ".join(html.escape(word) for word in (count, note, f"{seconds:.0f} s") if word)
    return f"{html.escape(description)} <progress{value}></progress> {words}"

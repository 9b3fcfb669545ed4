"""Progress and report of a batch of datasets."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text

from .exit_codes import WorkFailed
from .terminal import phase_note, print_json, print_lines, print_table, remark

if TYPE_CHECKING:
    from bentray_workers.reconstruction.batch import Entry

COLUMNS = ("name", "state", "progress", "misfit", "seconds")
NUMBERS = ("progress", "misfit", "seconds")

# Lines of the table besides its rows.
FRAME = 6


@contextmanager
def watching(entries: Sequence[Entry]) -> Iterator[Callable[[], None]]:
    """Yield a function that shows the progress: a live table on a terminal, else one line per dataset."""
    console = Console(stderr=True)
    if console.is_terminal:
        with Live(console=console, transient=True, auto_refresh=False) as live:
            yield lambda: live.update(live_table(entries, console.height), refresh=True)
        return
    reported = {entry.name for entry in entries if entry.state == "skipped"}

    def show() -> None:
        for entry in entries:
            if entry.state in ("succeeded", "failed") and entry.name not in reported:
                reported.add(entry.name)
                why = entry.reason or entry.doubt
                remark(f"{entry.name} {entry.state} after {entry.seconds:.1f} s {why}".rstrip())

    yield show


def live_table(entries: Sequence[Entry], height: int) -> Table:
    """Running datasets, then the most recently completed ones, with the number of datasets in each state."""
    counts = Counter(entry.state for entry in entries)
    running = [entry for entry in entries if entry.state == "running"]
    ended = [entry for entry in entries if entry.state in ("succeeded", "failed")]
    shown = [*running, *reversed(ended)][: max(1, height - FRAME)]
    title = f"{len(entries)} datasets: " + ", ".join(f"{n} {state}" for state, n in sorted(counts.items()))
    table = Table(title=title, title_justify="left")
    for name in COLUMNS:
        table.add_column(name, justify="right" if name in NUMBERS else "left", no_wrap=True)
    for entry in shown:
        table.add_row(*(Text(cell) for cell in cells(entry)))
    return table


def cells(entry: Entry) -> tuple[str, ...]:
    """One row of the table."""
    percent = 100 * entry.done // entry.total if entry.total else 0
    progress = f"{percent} %" if entry.state in ("running", "failed") else ""
    misfit = phase_note("", entry.residual_rms_s).removeprefix("residual ")
    seconds = "" if entry.state == "waiting" else f"{entry.seconds:.1f}"
    state = f"{entry.state}, doubtful" if entry.doubt else entry.state
    return entry.name, state, progress, misfit, seconds


def report(folder: Path, results: Path, entries: Sequence[Entry], *, as_json: bool) -> None:
    """Print the results of a batch as a table with the reasons of failures and doubts, or as JSON.

    Raises:
        WorkFailed: when a dataset failed.
    """
    counts = Counter(entry.state for entry in entries)
    failed = [entry for entry in entries if entry.state == "failed"]
    if as_json:
        states = {state: counts[state] for state in ("succeeded", "skipped", "failed")}
        print_json({"folder": str(folder), **states, "datasets": [_figures(results, row) for row in entries]})
    else:
        print_table(f"Batch of {folder.name}", COLUMNS, [cells(entry) for entry in entries], NUMBERS)
        print_lines(f"{row.name}: {row.reason or row.doubt}" for row in entries if row.reason or row.doubt)
        print_lines([str(results)])
    if failed:
        raise WorkFailed(f"{len(failed)} of {len(entries)} datasets failed: the reasons are above")


def _figures(results: Path, entry: Entry) -> dict[str, Any]:
    return {
        "name": entry.name,
        "file": str(entry.source),
        "state": entry.state,
        "seconds": round(entry.seconds, 3),
        "residual_rms_s": entry.residual_rms_s,
        "reason": entry.reason,
        "doubt": entry.doubt,
        "output": None if entry.state == "failed" else str(results / entry.name),
    }

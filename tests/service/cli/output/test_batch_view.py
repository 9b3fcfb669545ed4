"""The live table of a batch: running entries first, at most as high as the terminal, and its columns."""

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from bentray_kernels.tomography import Iteration, Progress
from bentray_service.cli.output.batch_view import cells, live_table
from bentray_workers.reconstruction.batch import Entry


def entry(name: str, state: str) -> Entry:
    result = Entry(Path(f"{name}.h5"))
    if state != "waiting":
        result.begin()
        result.show(Progress(3, 8, (Iteration(0, 1, 250e-9, 8),)))
    if state == "failed":
        result.end(state, "a reason")
    elif state == "succeeded":
        result.end(state)
    elif state == "skipped":
        result.skip(7.0, 1e-7)
    return result


STATES = st.sampled_from(["waiting", "running", "succeeded", "failed", "skipped"])


@given(states=st.lists(STATES, min_size=1, max_size=60), height=st.integers(10, 40))
def test_it_fits_the_terminal_and_shows_what_runs_first(states: list[str], height: int) -> None:
    entries = [entry(f"scan{number}", state) for number, state in enumerate(states)]
    console = Console(width=100, height=height, record=True, quiet=True)
    with console.capture() as said:
        console.quiet = False
        console.print(live_table(entries, height))
    lines = said.get().splitlines()
    assert len(lines) <= height
    assert lines[0].startswith(f"{len(states)} datasets: ")
    running = [item.name for item in entries if item.state == "running"]
    rows = [line.split("│")[1].strip() for line in lines if line.startswith("│")]
    assert rows[: len(running)] == running[: len(rows)]


def test_row_shows_progress_misfit_and_seconds() -> None:
    assert cells(entry("a", "waiting")) == ("a", "waiting", "", "", "")
    name, state, progress, misfit, seconds = cells(entry("b", "running"))
    assert (name, state, progress, misfit) == ("b", "running", "37 %", "250 ns")
    assert float(seconds) < 5.0
    assert cells(entry("c", "skipped")) == ("c", "skipped", "", "100 ns", "7.0")

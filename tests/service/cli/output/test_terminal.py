"""Figures go to stdout, everything else to stderr, JSON stays JSON; the live table of a batch."""

import json
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from bentray_kernels.tomography import Iteration, Progress
from bentray_service.cli.output.batch_view import cells, live_table
from bentray_service.cli.output.terminal import (
    phase_note,
    print_json,
    print_lines,
    print_table,
    progress_bar,
    remark,
    without_nan,
)
from bentray_workers.reconstruction.batch import Entry

values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)


@given(values)
def test_every_value_becomes_strict_json(value: object) -> None:
    again = json.loads(json.dumps(without_nan(value), allow_nan=False))
    assert again == without_nan(value)


def test_only_numbers_that_are_not_finite_become_null() -> None:
    assert without_nan({"a": (1.5, math.nan), "b": [{"c": -math.inf}], "d": 0}) == {
        "a": [1.5, None],
        "b": [{"c": None}],
        "d": 0,
    }


def test_stdout_contains_only_json(capsys: pytest.CaptureFixture[str]) -> None:
    remark("working")
    with progress_bar("Reconstructing") as step:
        step(1, 2, "residual 3 ns")
    print_json({"error": math.nan})
    said = capsys.readouterr()
    assert json.loads(said.out) == {"error": None}
    assert said.err == "working\n", "short work has no line"


def test_paths_are_printed_whole(capsys: pytest.CaptureFixture[str]) -> None:
    long = "/a/" + "b" * 300
    print_lines([long])
    assert capsys.readouterr().out == long + "\n"


def test_a_table_shows_its_cells_as_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    print_table("Title", ("name", "value"), [("[red]x[/red]", 1.5)], ("value",))
    out = capsys.readouterr().out
    assert "Title" in out
    assert "[red]x[/red]" in out
    assert "1.5" in out


def test_the_residual_is_shown_in_nanoseconds() -> None:
    assert phase_note("reconstructing", 1.234e-7) == "residual 123 ns"
    assert phase_note("reconstructing") == "reconstructing"
    assert phase_note("compiling", 1e-7) == "compiling kernels"


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

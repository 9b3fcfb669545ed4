"""Figures go to stdout, everything else to stderr, and JSON stays JSON."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_service.cli.output.terminal import (
    phase_note,
    print_json,
    print_lines,
    print_table,
    progress_bar,
    remark,
    without_nan,
)

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

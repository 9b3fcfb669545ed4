"""The progress bar: in the cell of a notebook, on a terminal, in lines of a log, off on request."""

import io
import sys
import time
from types import ModuleType, SimpleNamespace

import pytest
from rich.console import Console

from bentray_kernels.compilation import compiled
from bentray_kernels.compilation.compile_events import Compilation
from bentray_service.interactive import progress_bar as module
from bentray_service.interactive.progress_bar import bar_html, progress_bar


@pytest.fixture
def cell(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Texts of a notebook's cell, one entry for each drawing."""
    drawn: list[str] = []
    display = ModuleType("IPython.display")
    display.HTML = lambda text: text  # type: ignore[attr-defined]

    def show(text: str, *, display_id: bool) -> SimpleNamespace:
        assert display_id
        drawn.append(text)
        return SimpleNamespace(update=drawn.append)

    display.display = show  # type: ignore[attr-defined]
    ipython = ModuleType("IPython")
    ipython.get_ipython = lambda: SimpleNamespace(kernel=object())  # type: ignore[attr-defined]
    ipython.display = display  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    monkeypatch.setattr(module, "REDRAW_S", 0.0)
    return drawn


def test_a_notebook_has_one_bar_that_moves(cell: list[str]) -> None:
    with progress_bar("Reconstructing") as step:
        step(3, 4, "residual <5 ns")
    assert cell[0] == "Reconstructing <progress></progress> 0 s"
    assert cell[1] == 'Reconstructing <progress value="3" max="4"></progress> 3/4 residual &lt;5 ns 0 s'
    assert cell[2].startswith("Reconstructing: done after 0.")
    assert len(cell) == 3


def test_an_interrupted_bar_says_so(cell: list[str]) -> None:
    with pytest.raises(KeyboardInterrupt), progress_bar("Reconstructing"):
        raise KeyboardInterrupt
    assert cell[-1].startswith("Reconstructing: stopped after 0.")


def test_no_bar_on_request_or_in_a_plain_shell_of_ipython(
    cell: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with progress_bar("Reconstructing", shown=False) as step:
        step(1, 2)
    monkeypatch.setattr(sys.modules["IPython"], "get_ipython", lambda: SimpleNamespace())
    with progress_bar("Reconstructing") as step:
        step(1, 2)
    assert cell == []
    assert capsys.readouterr() == ("", "")


def test_a_bar_of_unknown_length_has_no_value() -> None:
    assert bar_html("Picking", 0, 0) == "Picking <progress></progress> 0 s"


@pytest.fixture
def compiling(monkeypatch: pytest.MonkeyPatch) -> list[Compilation]:
    """The counts of kernels, the last of which is now."""
    counts = [Compilation()]
    monkeypatch.setattr(compiled, "compilation", lambda: counts[-1])
    return counts


def test_a_line_of_a_log_has_count_note_and_clock(compiling: list[Compilation]) -> None:
    assert module.line("Starting", 0, 0, "", 2.4) == "Starting: 2 s"
    assert module.line("Reconstructing", 3, 8, "residual 80 ns", 12.0) == (
        "Reconstructing: 3 of 8, residual 80 ns, 12 s"
    )
    compiling.append(Compilation(31, 120, active=True))
    assert module.line("Reconstructing", 3, 8, "residual 80 ns", 12.0) == (
        "Reconstructing: compiling kernels 31 of 120, 12 s"
    )


def test_lines_come_until_the_work_ends(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(module, "FIRST_LINE_S", 0.0)
    monkeypatch.setattr(module, "LINE_S", 0.01)
    written = ""
    with progress_bar("Reconstructing") as step:
        step(3, 8, "picking")
        # Without a further step.
        while written.count("Reconstructing: 3 of 8, picking, 0 s\n") < 2:
            written += capsys.readouterr().err
    capsys.readouterr()
    time.sleep(0.1)
    assert capsys.readouterr() == ("", "")


def test_a_terminal_shows_kernels_clock_and_no_time_left_while_they_compile(
    compiling: list[Compilation], monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = io.StringIO()
    monkeypatch.setattr(module, "Console", lambda stderr: Console(file=drawn, force_terminal=True, width=120))
    with progress_bar("Reconstructing") as step:
        step(1, 8, "picking")
        compiling.append(Compilation(31, 120, active=True))
        while "compiling kernels 31 of 120" not in drawn.getvalue():
            time.sleep(0.01)
        *_, newest = drawn.getvalue().split("Reconstructing")
        assert "0:00:0" in newest
        assert "--:--" not in newest
        compiling.append(Compilation())
        step(0, 4, "sampling")
        while "0/4" not in drawn.getvalue():
            time.sleep(0.01)

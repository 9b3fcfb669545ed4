"""The progress bar: in the cell of a notebook, silent where nobody watches, off on request."""

import sys
from types import ModuleType, SimpleNamespace

import pytest

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
    assert cell[0] == "Reconstructing <progress></progress> "
    assert cell[1] == 'Reconstructing <progress value="3" max="4"></progress> 3/4 residual &lt;5 ns'
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
    assert bar_html("Picking", 0, 0) == "Picking <progress></progress> "

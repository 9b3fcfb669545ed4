"""What tests of several packages share: the figures that were drawn, with the words in them."""

from __future__ import annotations

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text


class Drawn(list[Figure]):
    """Figures in the order in which they became files."""

    def words(self) -> list[str]:
        """Every text that can be seen in the last one."""
        return [text.get_text() for text in self[-1].findobj(Text) if text.get_visible() and text.get_text()]


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> Drawn:
    """Collects each figure that is saved."""
    figures = Drawn()
    save = Figure.savefig

    def keep(figure: Figure, *words: object, **how: object) -> None:
        figures.append(figure)
        save(figure, *words, **how)

    monkeypatch.setattr(Figure, "savefig", keep)
    return figures

"""What tests of several packages share: figures that were drawn, and a PostgreSQL server."""

from __future__ import annotations

import secrets
from collections.abc import Iterator

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from . import postgresql


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


@pytest.fixture(scope="session")
def postgresql_server() -> Iterator[postgresql.Server]:
    """One server for all tests; each makes databases of its own. Skips where PostgreSQL is not installed."""
    if postgresql.programs() is None:
        pytest.skip(postgresql.SKIPPED)
    server = postgresql.Server("bentray", secrets.token_hex(8), "postgres")
    yield server
    server.close()

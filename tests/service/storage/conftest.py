"""Every kind of database that the service can use, each of them empty."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from bentray_service.storage.database import Database, open_database


@pytest.fixture(params=["sqlite", "postgresql"])
def address(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    """The address of a new database of each kind."""
    if request.param == "sqlite":
        yield f"sqlite:///{tmp_path / 'db.sqlite'}"
        return
    server = request.getfixturevalue("postgresql_server")
    found = server.new_database()
    yield found
    server.drop(found)


@pytest.fixture
def database(address: str) -> Iterator[Database]:
    """The same, open and with its tables."""
    opened = open_database(address)
    yield opened
    opened.close()

"""Every kind of database that the service can use, and what jobs need to be in one."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier
from typing import Any

import pytest

from bentray_service.rows.database import Database, open_database
from bentray_service.rows.ids import LOCAL, new_id, volume_of
from bentray_service.rows.job_queue import Queue
from bentray_service.rows.jobs import Jobs
from bentray_service.rows.stored_tables import Datasets

from ... import postgresql

SUMMARY = {
    "title": "",
    "source": "",
    "license": "",
    "dimension": 2,
    "elements": 3,
    "ntx": 3,
    "nrx": 3,
    "slices": 1,
    "has_traces": False,
    "has_travel_times": True,
    "has_truth": False,
    "water_speed_mps": 1500.0,
}


@pytest.fixture(scope="session")
def postgresql_database(postgresql_server: postgresql.Server) -> str:
    """The address of one database of PostgreSQL for all tests here."""
    return postgresql_server.new_database()


@pytest.fixture(params=["sqlite", "postgresql"])
def address(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    """The address of an empty database of each kind."""
    if request.param == "sqlite":
        yield f"sqlite:///{tmp_path / 'db.sqlite'}"
        return
    found = request.getfixturevalue("postgresql_database")
    yield found
    request.getfixturevalue("postgresql_server").empty(found)


@pytest.fixture
def database(address: str) -> Iterator[Database]:
    """The same, open and with its tables."""
    opened = open_database(address)
    yield opened
    opened.close()


@pytest.fixture
def jobs(database: Database) -> Jobs:
    return Jobs(database)


@pytest.fixture
def queue(database: Database) -> Queue:
    return Queue(database)


@pytest.fixture
def dataset(database: Database) -> str:
    """The id of a dataset of the local tenant."""
    row = Datasets(database).add(LOCAL, new_id("dataset"), size=1, sha256="0" * 64, summary=SUMMARY)
    return str(row.id)


def at_once(ask: Callable[[int], Any], number: int, *refusals: type[Exception]) -> list[Any]:
    """What each of many simultaneous calls gave: its result, or the refusal that it raised."""
    begin = Barrier(number)

    def call(k: int) -> Any:
        begin.wait()
        try:
            return ask(k)
        except refusals as refusal:
            return refusal

    with ThreadPoolExecutor(number) as pool:
        return list(pool.map(call, range(number)))


def volume_row(job_id: str, size: int = 1) -> dict[str, Any]:
    """The row of the result of a job."""
    return {
        "id": volume_of(job_id),
        "bytes": size,
        "axes": "x,y",
        "shape": [2, 2],
        "spacing_m": [1.0, 1.0],
        "origin_m": [0.0, 0.0],
        "speed_range_mps": [1.0, 2.0],
        "water_speed_mps": 1500.0,
        "provenance": {},
    }

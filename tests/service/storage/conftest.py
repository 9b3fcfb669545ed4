"""Every kind of database that the service can use, what jobs need to be in one, and buckets."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from bentray_service.storage import bucket, bucket_store
from bentray_service.storage.database import Database, open_database
from bentray_service.storage.datasets import Datasets
from bentray_service.storage.ids import new_id
from bentray_service.storage.jobs import Jobs
from bentray_service.storage.queue import Queue
from bentray_service.storage.tenants import LOCAL

from ... import s3

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
    return str(row["id"])


@pytest.fixture(scope="session")
def s3_server() -> Iterator[s3.Server]:
    """One server for all tests; each makes a bucket of its own."""
    server = s3.Server()
    yield server
    server.close()


@pytest.fixture
def bucket_url(s3_server: s3.Server, monkeypatch: pytest.MonkeyPatch) -> str:
    """The address of an empty bucket; it is asked once each time, and always anew whether it is there."""
    monkeypatch.setattr(bucket, "TRIES", {"total_max_attempts": 1})
    monkeypatch.setattr(bucket_store, "FRESH_S", 0.0)
    return s3_server.new_bucket(monkeypatch)

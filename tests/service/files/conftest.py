"""Buckets, and the databases of ``tests/service/rows``."""

from collections.abc import Iterator

import pytest

from bentray_service.files import bucket, bucket_store

from ... import s3
from ..rows.conftest import address, database, postgresql_database

__all__ = ["address", "bucket_url", "database", "postgresql_database", "s3_server"]


@pytest.fixture(scope="session")
def s3_server() -> Iterator[s3.Server]:
    """One server for all tests; each makes a bucket of its own."""
    server = s3.Server()
    yield server
    server.close()


@pytest.fixture
def bucket_url(s3_server: s3.Server, monkeypatch: pytest.MonkeyPatch) -> str:
    """The address of an empty bucket; it is asked once each time, and always anew whether it is there."""
    monkeypatch.setattr(bucket, "RETRIES", 0)
    monkeypatch.setattr(bucket_store, "FRESH_S", 0.0)
    return s3_server.new_bucket(monkeypatch)

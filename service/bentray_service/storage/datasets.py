"""The rows of datasets."""

from __future__ import annotations

import time
from typing import Any

from sqlalchemy import insert, select

from ..refusals import UnknownId
from .database import Database
from .ids import checked
from .schema import datasets

Row = dict[str, Any]


class Datasets:
    """What is known of each uploaded dataset; a row is never changed."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def add(self, dataset_id: str, *, size: int, sha256: str, summary: Row) -> Row:
        """Store a dataset; ``summary`` holds the columns that the ingest process filled."""
        with self._database.write() as connection:
            connection.execute(
                insert(datasets).values(
                    id=dataset_id, created=time.time(), bytes=size, sha256=sha256, **summary
                )
            )
        return self.get(dataset_id)

    def get(self, dataset_id: str) -> Row:
        """One dataset.

        Raises:
            UnknownId: when there is none.
        """
        with self._database.read() as connection:
            found = connection.execute(
                select(datasets).where(datasets.c.id == checked("dataset", dataset_id))
            )
            row = found.mappings().one_or_none()
        if row is None:
            raise UnknownId("dataset", dataset_id)
        return dict(row)

    def newest(self, limit: int) -> list[Row]:
        """Up to ``limit`` datasets, newest first."""
        with self._database.read() as connection:
            found = connection.execute(select(datasets).order_by(datasets.c.number.desc()).limit(limit))
            return [dict(row) for row in found.mappings()]

"""The rows of datasets."""

from __future__ import annotations

import time
from typing import Any

from sqlalchemy import insert, select

from ..refusals import UnknownId
from .database import Database
from .ids import checked
from .schema import datasets
from .tenants import Tenant
from .usage import keep

Row = dict[str, Any]


class Datasets:
    """What is known of each uploaded dataset; a row is never changed."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def add(self, tenant: Tenant, dataset_id: str, *, size: int, sha256: str, summary: Row) -> Row:
        """Store a dataset; ``summary`` holds the columns that the ingest process filled."""
        with self._database.write() as connection:
            connection.execute(
                insert(datasets).values(
                    tenant=tenant, id=dataset_id, created=time.time(), bytes=size, sha256=sha256, **summary
                )
            )
            keep(connection, tenant, dataset_id, size)
        return self.get(tenant, dataset_id)

    def get(self, tenant: Tenant, dataset_id: str) -> Row:
        """One dataset of this tenant.

        Raises:
            UnknownId: when it has no such one.
        """
        name = checked("dataset", dataset_id)
        mine = select(datasets).where(datasets.c.tenant == tenant, datasets.c.id == name)
        with self._database.read() as connection:
            row = connection.execute(mine).mappings().one_or_none()
        if row is None:
            raise UnknownId("dataset", dataset_id)
        return dict(row)

    def newest(self, tenant: Tenant, limit: int) -> list[Row]:
        """Up to ``limit`` datasets of this tenant, newest first."""
        mine = select(datasets).where(datasets.c.tenant == tenant)
        with self._database.read() as connection:
            found = connection.execute(mine.order_by(datasets.c.number.desc()).limit(limit))
            return [dict(row) for row in found.mappings()]

"""The rows of volumes: results of reconstructions and uploads, in two tables, told as one kind of row."""

from __future__ import annotations

import time
from typing import Any

from sqlalchemy import Select, insert, select

from ..refusals import UnknownId
from .database import Database
from .ids import checked
from .schema import datasets, jobs, uploaded_volumes, volumes
from .tenants import Tenant
from .usage import keep

Row = dict[str, Any]


class Volumes:
    """What is known of each volume; a row is written once and never changed.

    Every row has ``id``, ``created``, ``bytes``, ``title``, ``axes``, ``shape``, ``spacing_m``, ``origin_m``,
    ``value_range`` and ``unit``; that of a reconstruction also ``job_id``, ``dataset_id``,
    ``water_speed_mps`` and ``provenance``, that of an upload ``sha256``.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def add(self, tenant: Tenant, volume_id: str, *, size: int, sha256: str, summary: Row) -> Row:
        """Store an uploaded volume; ``summary`` holds the columns that the ingest process filled."""
        with self._database.write() as connection:
            connection.execute(
                insert(uploaded_volumes).values(
                    tenant=tenant, id=volume_id, created=time.time(), bytes=size, sha256=sha256, **summary
                )
            )
            keep(connection, tenant, volume_id, size)
        return self.get(tenant, volume_id)

    def get(self, tenant: Tenant, volume_id: str) -> Row:
        """One volume of this tenant, of either table.

        Raises:
            UnknownId: when it has no such one.
        """
        name = checked("volume", volume_id)
        found = self._rows(
            _reconstructed(tenant).where(volumes.c.id == name),
            _uploaded(tenant).where(uploaded_volumes.c.id == name),
        )
        if not found:
            raise UnknownId("volume", volume_id)
        return found[0]

    def newest(self, tenant: Tenant, limit: int) -> list[Row]:
        """Up to ``limit`` volumes of this tenant, of both tables, newest first."""
        found = self._rows(
            _reconstructed(tenant).order_by(volumes.c.created.desc()).limit(limit),
            _uploaded(tenant).order_by(uploaded_volumes.c.created.desc()).limit(limit),
        )
        return sorted(found, key=lambda row: row["created"], reverse=True)[:limit]

    def _rows(self, reconstructed: Select[Any], uploaded: Select[Any]) -> list[Row]:
        with self._database.read() as connection:
            results = [dict(row) for row in connection.execute(reconstructed).mappings()]
            uploads = [dict(row) for row in connection.execute(uploaded).mappings()]
        return [
            *({**row, "unit": "m/s", "value_range": row["speed_range_mps"]} for row in results),
            *({**row, "unit": "", "axes": "x,y,z"} for row in uploads),
        ]


def _reconstructed(tenant: Tenant) -> Select[Any]:
    return (
        select(volumes, jobs.c.dataset_id, datasets.c.title)
        .join(jobs, jobs.c.id == volumes.c.job_id)
        .join(datasets, datasets.c.id == jobs.c.dataset_id)
        .where(volumes.c.tenant == tenant)
    )


def _uploaded(tenant: Tenant) -> Select[Any]:
    return select(uploaded_volumes).where(uploaded_volumes.c.tenant == tenant)

"""The rows of meshes."""

from __future__ import annotations

import time
from typing import Any

from sqlalchemy import insert, select

from ..refusals import UnknownId
from .database import Database
from .ids import checked
from .schema import meshes
from .tenants import Tenant
from .usage import keep

Row = dict[str, Any]


class Meshes:
    """What is known of each mesh, uploaded or made of a volume; a row is never changed."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def add(self, tenant: Tenant, mesh_id: str, *, size: int, sha256: str, summary: Row) -> Row:
        """Store a mesh; ``summary`` holds the columns that tell what is in its file."""
        with self._database.write() as connection:
            connection.execute(
                insert(meshes).values(
                    tenant=tenant, id=mesh_id, created=time.time(), bytes=size, sha256=sha256, **summary
                )
            )
            keep(connection, tenant, mesh_id, size)
        return self.get(tenant, mesh_id)

    def get(self, tenant: Tenant, mesh_id: str) -> Row:
        """One mesh of this tenant.

        Raises:
            UnknownId: when it has no such one.
        """
        mine = select(meshes).where(meshes.c.tenant == tenant, meshes.c.id == checked("mesh", mesh_id))
        with self._database.read() as connection:
            row = connection.execute(mine).mappings().one_or_none()
        if row is None:
            raise UnknownId("mesh", mesh_id)
        return dict(row)

    def newest(self, tenant: Tenant, limit: int) -> list[Row]:
        """Up to ``limit`` meshes of this tenant, newest first."""
        mine = select(meshes).where(meshes.c.tenant == tenant)
        with self._database.read() as connection:
            found = connection.execute(mine.order_by(meshes.c.number.desc()).limit(limit))
            return [dict(row) for row in found.mappings()]

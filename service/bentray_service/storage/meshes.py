"""The rows of meshes."""

from __future__ import annotations

import time
from typing import Any

from sqlalchemy import insert, select

from ..refusals import UnknownId
from .database import Database
from .ids import checked
from .schema import meshes

Row = dict[str, Any]


class Meshes:
    """What is known of each mesh, uploaded or made of a volume; a row is never changed."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def add(self, mesh_id: str, *, size: int, sha256: str, summary: Row) -> Row:
        """Store a mesh; ``summary`` holds the columns that tell what is in its file."""
        with self._database.write() as connection:
            connection.execute(
                insert(meshes).values(id=mesh_id, created=time.time(), bytes=size, sha256=sha256, **summary)
            )
        return self.get(mesh_id)

    def get(self, mesh_id: str) -> Row:
        """One mesh.

        Raises:
            UnknownId: when there is none.
        """
        with self._database.read() as connection:
            found = connection.execute(select(meshes).where(meshes.c.id == checked("mesh", mesh_id)))
            row = found.mappings().one_or_none()
        if row is None:
            raise UnknownId("mesh", mesh_id)
        return dict(row)

    def newest(self, limit: int) -> list[Row]:
        """Up to ``limit`` meshes, newest first."""
        with self._database.read() as connection:
            found = connection.execute(select(meshes).order_by(meshes.c.number.desc()).limit(limit))
            return [dict(row) for row in found.mappings()]

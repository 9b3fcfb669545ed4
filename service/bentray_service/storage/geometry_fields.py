"""The rows of geometry fields; jobs write them when they succeed."""

from __future__ import annotations

from typing import Any

from sqlalchemy import select

from ..refusals import UnknownId
from .database import Database
from .ids import checked
from .schema import geometry_fields

Row = dict[str, Any]


class GeometryFields:
    """What is known of each geometry field; a row is never changed."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def get(self, field_id: str) -> Row:
        """One field.

        Raises:
            UnknownId: when there is none.
        """
        name = checked("field", field_id)
        with self._database.read() as connection:
            found = connection.execute(select(geometry_fields).where(geometry_fields.c.id == name))
            row = found.mappings().one_or_none()
        if row is None:
            raise UnknownId("field", field_id)
        return dict(row)

    def newest(self, limit: int) -> list[Row]:
        """Up to ``limit`` fields, newest first."""
        query = select(geometry_fields).order_by(geometry_fields.c.number.desc()).limit(limit)
        with self._database.read() as connection:
            return [dict(row) for row in connection.execute(query).mappings()]

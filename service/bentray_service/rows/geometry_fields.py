"""The rows of geometry fields; jobs write them when they succeed."""

from __future__ import annotations

from typing import Any

from sqlalchemy import select

from ..refusals import UnknownId
from .database import Database
from .ids import checked
from .schema import geometry_fields
from .tenants import Tenant

Row = dict[str, Any]


class GeometryFields:
    """What is known of each geometry field; a row is never changed."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def get(self, tenant: Tenant, field_id: str) -> Row:
        """One field of this tenant.

        Raises:
            UnknownId: when it has no such one.
        """
        name = checked("field", field_id)
        table = geometry_fields.c
        mine = select(geometry_fields).where(table.tenant == tenant, table.id == name)
        with self._database.read() as connection:
            row = connection.execute(mine).mappings().one_or_none()
        if row is None:
            raise UnknownId("field", field_id)
        return dict(row)

    def newest(self, tenant: Tenant, limit: int) -> list[Row]:
        """Up to ``limit`` fields of this tenant, newest first."""
        mine = select(geometry_fields).where(geometry_fields.c.tenant == tenant)
        query = mine.order_by(geometry_fields.c.number.desc()).limit(limit)
        with self._database.read() as connection:
            return [dict(row) for row in connection.execute(query).mappings()]

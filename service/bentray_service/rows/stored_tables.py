"""Tables of stored items, one row per item: datasets, volumes, meshes and geometry fields."""

from __future__ import annotations

import time
from typing import Any, ClassVar, Generic, TypeVar, cast

from sqlalchemy import Connection, Table, func, insert, select, update

from ..errors import UnknownId
from . import schema
from .database import Database
from .idempotency import RequestKey
from .ids import checked
from .job_search import contains
from .schema import datasets, jobs, uploaded_volumes, volumes
from .tenants import Tenant
from .typed_rows import DatasetRow, FieldRow, MeshRow, Plain, VolumeRow
from .usage import keep

Record = TypeVar("Record")


class TenantTable(Generic[Record]):
    """A table whose queries are restricted to one tenant.

    Attributes:
        table: the SQL table.
        what: the type of its items, a key of ``ids.PREFIXES``.
    """

    table: ClassVar[Table]
    what: ClassVar[str]

    def __init__(self, database: Database) -> None:
        self._database = database

    def get(self, tenant: Tenant, name: str) -> Record:
        """One row of this tenant by id.

        Raises:
            UnknownId: when the tenant has no such item.
        """
        rows = self._select(tenant, 1, checked(self.what, name))
        if not rows:
            raise UnknownId(self.what, name)
        return cast(Record, rows[0])

    def newest(self, tenant: Tenant, limit: int) -> list[Record]:
        """Up to ``limit`` rows of this tenant, newest first."""
        return cast(list[Record], self._select(tenant, limit))

    def _select(self, tenant: Tenant, limit: int, name: str | None = None) -> list[Plain]:
        table = self.table.c
        query = select(self.table).where(table.tenant == tenant)
        if name is not None:
            query = query.where(table.id == name)
        return self._database.rows(query.order_by(table.number.desc()).limit(limit))


class NamedTable(TenantTable[Record]):
    """A table whose items have a name and notes of the user, ``schema.named_columns``."""

    def describe(self, tenant: Tenant, item: str, **words: str | float | None) -> Record:
        """Replace the ``name``, the ``notes`` or other statements of the user; returns the row.

        Raises:
            UnknownId: when the tenant has no such item.
        """
        mine = self.table.c.tenant == tenant, self.table.c.id == checked(self.what, item)
        if words:
            with self._database.write() as connection:
                connection.execute(update(self.table).where(*mine).values(**words))
        return self.get(tenant, item)


class UploadedTable(TenantTable[Record]):
    """A table of uploaded items; rows are never changed, except for names and notes."""

    def add(self, tenant: Tenant, name: str, *, size: int, sha256: str, summary: Plain) -> Record:
        """Insert a row; ``summary`` holds the columns that describe the content of the file."""
        with self._database.write() as connection:
            self._insert(connection, tenant, name, size, sha256, summary)
        return self.get(tenant, name)

    def _insert(
        self, connection: Connection, tenant: Tenant, name: str, size: int, sha256: str, summary: Plain
    ) -> None:
        row = {"tenant": tenant, "id": name, "created": time.time(), "bytes": size, "sha256": sha256}
        connection.execute(insert(self.table).values(**row, **summary))
        keep(connection, tenant, name, size)


class Datasets(UploadedTable[DatasetRow], NamedTable[DatasetRow]):
    """Scans, uploaded or simulated."""

    table, what = datasets, "dataset"

    def made_by(self, tenant: Tenant, request: RequestKey) -> DatasetRow | None:
        """The scan that an earlier request with the idempotency key of this one made.

        Raises:
            KeyReused: when it was another request.
        """
        if request.key is None:
            return None
        with self._database.write() as connection:
            return cast(DatasetRow | None, request.earlier(connection, datasets, tenant))

    def add_once(
        self, tenant: Tenant, name: str, request: RequestKey, *, size: int, sha256: str, summary: Plain
    ) -> DatasetRow:
        """As ``add``, for a request; gives the row of an equal one that was faster, which has another id.

        Raises:
            KeyReused: as ``made_by``.
        """
        with self._database.write() as connection:
            before = request.earlier(connection, datasets, tenant)
            if before is None:
                self._insert(connection, tenant, name, size, sha256, summary | request.columns())
        return self.get(tenant, name) if before is None else cast(DatasetRow, before)

    def found(
        self, tenant: Tenant, limit: int, before: str | None = None, text: str | None = None
    ) -> list[DatasetRow]:
        """Up to ``limit`` scans of this tenant, newest first.

        Args:
            tenant: owner.
            limit: maximum number.
            before: only scans older than the one with this id.
            text: only scans with this text in their id, name, title or notes, see ``job_search.contains``.

        Raises:
            UnknownId: when the tenant has no such scan.
        """
        scans = datasets.c
        query = select(datasets).where(scans.tenant == tenant).order_by(scans.number.desc()).limit(limit)
        if text:
            query = query.where(contains(text, scans.id, scans.name, scans.title, scans.notes))
        if before is not None:
            query = query.where(scans.number < self.get(tenant, before)["number"])
        return cast(list[DatasetRow], self._database.rows(query))


class Meshes(UploadedTable[MeshRow]):
    """Meshes, uploaded or iso-surfaces of volumes."""

    table, what = schema.meshes, "mesh"


class GeometryFields(TenantTable[FieldRow]):
    """Geometry fields; rows are inserted when a job succeeds."""

    table, what = schema.geometry_fields, "field"


class Volumes(UploadedTable[VolumeRow]):
    """Volumes: uploads, and results of reconstructions from a second table."""

    table, what = uploaded_volumes, "volume"

    def _select(self, tenant: Tenant, limit: int, name: str | None = None) -> list[Plain]:
        reconstructed: Any = (
            select(
                volumes,
                jobs.c.dataset_id,
                func.coalesce(func.nullif(datasets.c.name, ""), datasets.c.title).label("title"),
            )
            .join(jobs, jobs.c.id == volumes.c.job_id)
            .join(datasets, datasets.c.id == jobs.c.dataset_id)
        )
        rows: list[Plain] = []
        for table, query in ((volumes, reconstructed), (uploaded_volumes, select(uploaded_volumes))):
            mine = query.where(table.c.tenant == tenant)
            if name is not None:
                mine = mine.where(table.c.id == name)
            rows += self._database.rows(mine.order_by(table.c.created.desc()).limit(limit))
        for row in rows:
            made = "job_id" in row
            row |= (
                {"unit": "m/s", "value_range": row["speed_range_mps"]}
                if made
                else {"unit": "", "axes": "x,y,z"}
            )
        return sorted(rows, key=lambda row: float(row["created"]), reverse=True)[:limit]

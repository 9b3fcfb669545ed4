"""Tables of stored items, one row per item: datasets, volumes, meshes and geometry fields."""

from __future__ import annotations

import time
from typing import ClassVar, Generic, TypeVar

from sqlalchemy import select, update
from sqlalchemy.orm import Session

from ..errors import UnknownId
from .database import Database
from .idempotency import RequestKey
from .ids import checked
from .job_search import contains
from .tables import (
    DatasetRow,
    FieldRow,
    JobRow,
    MeshRow,
    Plain,
    ResultVolumeRow,
    UploadedVolumeRow,
    UploadRow,
    VolumeRow,
)
from .tenants import Tenant
from .usage import keep

Record = TypeVar("Record", bound=DatasetRow | JobRow | MeshRow | FieldRow | UploadRow | UploadedVolumeRow)
Named = TypeVar("Named", bound=DatasetRow | JobRow)
Uploaded = TypeVar("Uploaded", bound=DatasetRow | MeshRow | UploadedVolumeRow)


class TenantTable(Generic[Record]):
    """A table whose queries are restricted to one tenant.

    Attributes:
        table: the class of its rows.
        what: the type of its items, a key of ``ids.PREFIXES``.
    """

    table: type[Record]
    what: ClassVar[str]

    def __init__(self, database: Database) -> None:
        self._database = database

    def get(self, tenant: Tenant, name: str) -> Record:
        """One row of this tenant by id.

        Raises:
            UnknownId: when the tenant has no such item.
        """
        query = select(self.table).filter_by(tenant=tenant, id=checked(self.what, name))
        with self._database.read() as session:
            row = session.scalar(query)
        if row is None:
            raise UnknownId(self.what, name)
        return row

    def newest(self, tenant: Tenant, limit: int) -> list[Record]:
        """Up to ``limit`` rows of this tenant, newest first."""
        query = select(self.table).where(self.table.tenant == tenant)
        return self._database.rows(query.order_by(self.table.number.desc()).limit(limit))


class NamedTable(TenantTable[Named]):
    """A table whose items have a name and notes of the user."""

    def describe(self, tenant: Tenant, item: str, **words: str | float | None) -> Named:
        """Replace the ``name``, the ``notes`` or other statements of the user; returns the row.

        Raises:
            UnknownId: when the tenant has no such item.
        """
        mine = update(self.table).filter_by(tenant=tenant, id=checked(self.what, item))
        if words:
            with self._database.write() as session:
                session.execute(mine.values(**words))
        return self.get(tenant, item)


class UploadedTable(TenantTable[Uploaded]):
    """A table of uploaded items; rows are never changed, except for names and notes."""

    def add(self, tenant: Tenant, name: str, *, size: int, sha256: str, summary: Plain) -> Uploaded:
        """Insert a row; ``summary`` holds the columns that describe the content of the file."""
        with self._database.write() as session:
            self._insert(session, tenant, name, size, sha256, summary)
        return self.get(tenant, name)

    def _insert(
        self, session: Session, tenant: Tenant, name: str, size: int, sha256: str, summary: Plain
    ) -> None:
        row = {"tenant": tenant, "id": name, "created": time.time(), "bytes": size, "sha256": sha256}
        session.add(self.table(**row, **summary))
        keep(session, tenant, name, size)


class Datasets(UploadedTable[DatasetRow], NamedTable[DatasetRow]):
    """Scans, uploaded or simulated."""

    table, what = DatasetRow, "dataset"

    def made_by(self, tenant: Tenant, request: RequestKey) -> DatasetRow | None:
        """The scan that an earlier request with the idempotency key of this one made.

        Raises:
            KeyReused: when it was another request.
        """
        if request.key is None:
            return None
        with self._database.write() as session:
            return request.earlier(session, DatasetRow, tenant)

    def add_once(
        self, tenant: Tenant, name: str, request: RequestKey, *, size: int, sha256: str, summary: Plain
    ) -> DatasetRow:
        """Add a row for a request, or return an equal row that was added first, which has another id.

        Raises:
            KeyReused: as ``made_by``.
        """
        with self._database.write() as session:
            before = request.earlier(session, DatasetRow, tenant)
            if before is None:
                self._insert(session, tenant, name, size, sha256, summary | request.columns())
        return self.get(tenant, name) if before is None else before

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
        scans = DatasetRow
        query = select(scans).where(scans.tenant == tenant).order_by(scans.number.desc()).limit(limit)
        if text:
            query = query.where(contains(text, scans.id, scans.name, scans.title, scans.notes))
        if before is not None:
            query = query.where(scans.number < self.get(tenant, before).number)
        return self._database.rows(query)


class Meshes(UploadedTable[MeshRow]):
    """Meshes, uploaded or iso-surfaces of volumes."""

    table, what = MeshRow, "mesh"


class GeometryFields(TenantTable[FieldRow]):
    """Geometry fields; rows are inserted when a job succeeds."""

    table, what = FieldRow, "field"


class UploadedVolumes(UploadedTable[UploadedVolumeRow]):
    """Uploaded volumes."""

    table, what = UploadedVolumeRow, "volume"


class Volumes:
    """Volumes: results of reconstructions and uploads, which have tables of their own."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self.uploaded = UploadedVolumes(database)

    def get(self, tenant: Tenant, name: str) -> VolumeRow:
        """One volume of this tenant by id.

        Raises:
            UnknownId: when the tenant has no such volume.
        """
        mine = select(ResultVolumeRow).filter_by(tenant=tenant, id=checked("volume", name))
        with self._database.read() as session:
            row = session.scalar(mine)
        return row or self.uploaded.get(tenant, name)

    def newest(self, tenant: Tenant, limit: int) -> list[VolumeRow]:
        """Up to ``limit`` volumes of this tenant, newest first."""
        table = ResultVolumeRow
        mine = select(table).where(table.tenant == tenant).order_by(table.created.desc()).limit(limit)
        rows: list[VolumeRow] = [*self._database.rows(mine), *self.uploaded.newest(tenant, limit)]
        return sorted(rows, key=lambda row: row.created, reverse=True)[:limit]

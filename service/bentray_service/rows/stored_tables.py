"""Tables of stored items, one row per item; repeated requests, search by text, and ids in use."""

from __future__ import annotations

import hashlib
import json
import time
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, TypeVar

from sqlalchemy import ColumnElement, SQLColumnExpression, func, literal, or_, select, update
from sqlalchemy.orm import Session, aliased

from ..errors import KeyReused, UnknownId
from .database import Database, Repository, take_lock
from .ids import PREFIXES, Tenant, checked
from .tables import (
    ENDED,
    WITH_FILES,
    BatchRow,
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
from .usage import keep

# The tables of what a request with a key makes.
Row = TypeVar("Row", DatasetRow, JobRow, BatchRow)
ESCAPE = "\\"


@dataclass(frozen=True)
class RequestKey:
    """The idempotency key of a request, and what it was used for.

    Attributes:
        key: of the client; None: the request has none, and is never taken for a repeated one.
        digest: SHA-256 of the request.
    """

    key: str | None
    digest: str

    @classmethod
    def from_header(cls, key: str | None, request: object) -> RequestKey:
        """The key of a request, given as what JSON can hold."""
        return cls(key, hashlib.sha256(json.dumps(request, sort_keys=True).encode()).hexdigest())

    def columns(self) -> Plain:
        """The values of a row that the request inserts."""
        return {"idempotency_key": self.key, "request_sha256": self.digest}

    def earlier(self, session: Session, table: type[Row], tenant: Tenant) -> Row | None:
        """The row that an earlier request with this key inserted; concurrent requests with it wait.

        Args:
            session: in a write transaction.
            table: with the columns of ``columns``.
            tenant: owner.

        Raises:
            KeyReused: when it was another request.
        """
        if self.key is None:
            return None
        take_lock(session, f"{tenant}/{self.key}")
        mine = select(table).filter_by(tenant=tenant, idempotency_key=self.key)
        row = session.scalars(mine).one_or_none()
        if row is not None and row.request_sha256 != self.digest:
            accepted = "a unique key for every request; this key was used with another request"
            raise KeyReused("Idempotency-Key", repr(self.key), accepted)
        if row is not None:
            row.replayed = True
        return row


Record = TypeVar("Record", bound=DatasetRow | JobRow | MeshRow | FieldRow | UploadRow | UploadedVolumeRow)
Named = TypeVar("Named", bound=DatasetRow | JobRow)
Uploaded = TypeVar("Uploaded", bound=DatasetRow | MeshRow | UploadedVolumeRow)


class TenantTable(Repository, Generic[Record]):
    """A table whose queries are restricted to one tenant.

    Attributes:
        table: the class of its rows.
        what: the type of its items, a key of ``ids.PREFIXES``.
    """

    table: type[Record]
    what: ClassVar[str]

    def get(self, tenant: Tenant, name: str) -> Record:
        """One row of this tenant by id.

        Raises:
            UnknownId: when the tenant has no such item.
        """
        row = self._database.row(select(self.table).filter_by(tenant=tenant, id=checked(self.what, name)))
        if row is None:
            raise UnknownId(self.what, name)
        return row

    def newest(
        self, tenant: Tenant, limit: int, *only: ColumnElement[bool], before: str | None = None
    ) -> list[Record]:
        """Up to ``limit`` rows of this tenant, newest first.

        Args:
            tenant: owner.
            limit: maximum number.
            only: conditions.
            before: only items older than the one with this id.

        Raises:
            UnknownId: when the tenant has no such item.
        """
        query = select(self.table).where(self.table.tenant == tenant, *only)
        if before is not None:
            query = query.where(self.table.number < self.get(tenant, before).number)
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
            self._database.change(mine.values(**words))
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

    def search(
        self, tenant: Tenant, limit: int, before: str | None = None, text: str | None = None
    ) -> list[DatasetRow]:
        """Newest scans with ``text`` in their id, name, title or notes, see ``contains``; see ``newest``."""
        scans = DatasetRow
        only = [contains(text, scans.id, scans.name, scans.title, scans.notes)] if text else []
        return self.newest(tenant, limit, *only, before=before)


class Meshes(UploadedTable[MeshRow]):
    """Meshes, uploaded or iso-surfaces of volumes."""

    table, what = MeshRow, "mesh"


class GeometryFields(TenantTable[FieldRow]):
    """Geometry fields; rows are inserted when a job succeeds."""

    table, what = FieldRow, "field"


class UploadedVolumes(UploadedTable[UploadedVolumeRow]):
    """Uploaded volumes."""

    table, what = UploadedVolumeRow, "volume"


class Volumes(Repository):
    """Volumes: results of reconstructions and uploads, which have tables of their own."""

    def __init__(self, database: Database) -> None:
        super().__init__(database)
        self.uploaded = UploadedVolumes(database)

    def get(self, tenant: Tenant, name: str) -> VolumeRow:
        """One volume of this tenant by id.

        Raises:
            UnknownId: when the tenant has no such volume.
        """
        mine = select(ResultVolumeRow).filter_by(tenant=tenant, id=checked("volume", name))
        return self._database.row(mine) or self.uploaded.get(tenant, name)

    def newest(self, tenant: Tenant, limit: int) -> list[VolumeRow]:
        """Up to ``limit`` volumes of this tenant, newest first."""
        table = ResultVolumeRow
        mine = select(table).where(table.tenant == tenant).order_by(table.created.desc()).limit(limit)
        rows: list[VolumeRow] = [*self._database.rows(mine), *self.uploaded.newest(tenant, limit)]
        return sorted(rows, key=lambda row: row.created, reverse=True)[:limit]


def matches(tenant: Tenant, words: str) -> ColumnElement[bool]:
    """Whether a job has a text: in id, name, notes or owner, or in the id or title of scan, volume or mesh.

    Letters match in both cases (with SQLite only those of ASCII). Titles of other tenants match nothing.

    Args:
        tenant: owner.
        words: without NUL, which PostgreSQL stores in no text.
    """
    scans = select(DatasetRow.id).where(
        DatasetRow.tenant == tenant, contains(words, DatasetRow.name, DatasetRow.title)
    )
    made_here = select(DatasetRow.job_id).where(DatasetRow.id.in_(scans), DatasetRow.job_id.is_not(None))
    made = aliased(JobRow)
    reconstructed = (
        select(ResultVolumeRow.id)
        .join(made, made.id == ResultVolumeRow.job_id)
        .where(ResultVolumeRow.tenant == tenant, made.dataset_id.in_(scans))
    )
    return or_(
        contains(words, JobRow.id, JobRow.name, JobRow.notes, JobRow.started_by),
        contains(words, JobRow.dataset_id, JobRow.volume_id, JobRow.mesh_id),
        JobRow.dataset_id.in_(scans),
        JobRow.id.in_(made_here),
        JobRow.volume_id.in_(reconstructed),
        JobRow.volume_id.in_(_titled(UploadedVolumeRow, tenant, words)),
        JobRow.mesh_id.in_(_titled(MeshRow, tenant, words)),
    )


def _titled(table: Any, tenant: Tenant, words: str) -> Any:
    return select(table.id).where(table.tenant == tenant, contains(words, table.title))


Text = SQLColumnExpression[str] | SQLColumnExpression[str | None]


def contains(words: str, *columns: Text) -> ColumnElement[bool]:
    """Whether one of the columns contains the words, as they are: no character is a pattern."""
    for special in (ESCAPE, "%", "_"):
        words = words.replace(special, ESCAPE + special)
    # Both sides by the database, whose lower() decides which letters have two cases.
    pattern = func.lower(literal(f"%{words}%"))
    return or_(*(func.lower(column).like(pattern, escape=ESCAPE) for column in columns))


# Tenant and id.
Name = tuple[str, str]


class LiveIds(Repository):
    """Queries over all tenants, for cleaning up files."""

    def names(self) -> set[Name]:
        """All ids that may have files, including those of uploads and jobs in progress."""
        with self._database.read() as session:
            names = self._of_jobs(session)
            for table in (*WITH_FILES, UploadRow):
                names |= {(tenant, name) for tenant, name in session.execute(select(table.tenant, table.id))}
            coming = select(UploadRow.tenant, UploadRow.result_id).where(UploadRow.state == "reading")
            return names | {(row.tenant, row.result_id) for row in session.execute(coming)}

    def needed(self) -> set[str]:
        """The ids of inputs and outputs of unfinished jobs."""
        with self._database.read() as session:
            return {name for _, name in self._of_jobs(session)}

    def _of_jobs(self, session: Session) -> set[Name]:
        reads = JobRow.dataset_id, JobRow.volume_id, JobRow.mesh_id, JobRow.field_id
        names: set[Name] = set()
        unfinished = select(JobRow.tenant, JobRow.id, *reads).where(JobRow.state.not_in(ENDED))
        for row in session.execute(unfinished):
            # The result of a job has the id of the job with another prefix.
            own = row.id.removeprefix(PREFIXES["job"])
            made = (prefix + own for prefix in PREFIXES.values())
            names |= {(row.tenant, name) for name in (*row[2:], *made) if name is not None}
        return names

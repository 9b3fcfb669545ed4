"""The table of checksums: size and SHA-256 of every stored file when it was written."""

from __future__ import annotations

import time
from collections.abc import Collection
from typing import NamedTuple, cast

from sqlalchemy import Connection, delete, func, insert, select, update

from .database import Database
from .schema import checksums, datasets, geometry_fields, jobs, meshes, uploaded_volumes, volumes
from .tenants import Tenant
from .typed_rows import ChecksumRow, Plain

# Tables whose rows have stored files; the file of a turntable belongs to its job.
STORED = (datasets, uploaded_volumes, volumes, meshes, geometry_fields, jobs)


class Digest(NamedTuple):
    """The digest of a file, or of all files in a folder.

    Attributes:
        bytes: total size.
        sha256: hexadecimal; for a folder, of the names and digests of its files.
    """

    bytes: int
    sha256: str


class Checksums:
    """Checksums by tenant and id."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def record(self, tenant: Tenant, name: str, path: str, digest: Digest, *, as_written: bool) -> None:
        """Insert or replace the checksum of an item.

        Args:
            tenant: owner.
            name: id of the item.
            path: below the folder of the tenant, e.g. ``volumes/vol-0123456789abcdef0123.h5``.
            digest: the checksum.
            as_written: whether it was computed when the file was written.
        """
        with self._database.write() as connection:
            _record(connection, tenant, name, path, digest, as_written)

    def record_first_seen(self, tenant: Tenant, name: str, path: str, digest: Digest) -> bool:
        """Insert the checksum of an item stored before version 4.

        Returns:
            False, without a change, if the item has been deleted; its file may remain for a moment.
        """
        with self._database.write() as connection:
            known = any(
                connection.execute(
                    # A concurrent deletion finishes first.
                    select(table.c.id).where(table.c.tenant == tenant, table.c.id == name).with_for_update()
                ).first()
                for table in STORED
            )
            if known:
                _record(connection, tenant, name, path, digest, as_written=False)
            return known

    def get(self, tenant: Tenant, name: str) -> ChecksumRow | None:
        """The checksum of an item; None if it was stored before version 4 or has been deleted."""
        mine = select(checksums).where(checksums.c.tenant == tenant, checksums.c.id == name)
        rows = self._database.rows(mine)
        return cast(ChecksumRow, rows[0]) if rows else None

    def all(self) -> list[ChecksumRow]:
        """The checksums of all tenants."""
        query = select(checksums).order_by(checksums.c.tenant, checksums.c.path)
        return cast(list[ChecksumRow], self._database.rows(query))

    def count_damaged(self) -> int:
        """The number of items of all tenants that are known to be damaged."""
        query = select(func.count()).select_from(checksums).where(checksums.c.damaged.is_not(None))
        with self._database.read() as connection:
            return int(connection.execute(query).scalar_one())

    def damaged(self, tenant: Tenant, name: str, since: float | None) -> None:
        """Store since when an item is damaged, s since 1970; None: it is not damaged."""
        mine = checksums.c.tenant == tenant, checksums.c.id == name
        with self._database.write() as connection:
            connection.execute(update(checksums).where(*mine).values(damaged=since))

    def delete(self, tenant: Tenant, names: Collection[str]) -> None:
        """Delete the checksums of items by id."""
        with self._database.write() as connection:
            delete_checksums(connection, tenant, names)


def _record(
    connection: Connection, tenant: Tenant, name: str, path: str, digest: Digest, as_written: bool
) -> None:
    now: Plain = {"path": path, "bytes": digest.bytes, "sha256": digest.sha256, "noted": time.time()}
    now |= {"as_written": as_written, "damaged": None}
    mine = checksums.c.tenant == tenant, checksums.c.id == name
    if not connection.execute(update(checksums).where(*mine).values(**now)).rowcount:
        connection.execute(insert(checksums).values(tenant=tenant, id=name, **now))


def delete_checksums(connection: Connection, tenant: Tenant, names: Collection[str]) -> None:
    """The same within the transaction of the caller."""
    connection.execute(delete(checksums).where(checksums.c.tenant == tenant, checksums.c.id.in_(names)))

"""The rows of checksums: what every stored file held when it was written."""

from __future__ import annotations

import time
from collections.abc import Collection
from typing import cast

from sqlalchemy import Connection, delete, insert, select, update

from .database import Database
from .digests import Digest
from .records import ChecksumRow, Plain
from .schema import checksums, datasets, geometry_fields, jobs, meshes, uploaded_volumes, volumes
from .tenants import Tenant

# Where a thing that is stored has its row; that of a turntable is its job's.
STORED = (datasets, uploaded_volumes, volumes, meshes, geometry_fields, jobs)


class Checksums:
    """A row for each thing that is stored, by its tenant and its id."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def record(self, tenant: Tenant, name: str, path: str, found: Digest, *, as_written: bool) -> None:
        """Store what a thing holds, in place of what it held before.

        Args:
            tenant: whose it is.
            name: its id.
            path: in the tenant's folder, as ``volumes/vol-0123456789abcdef0123.h5``.
            found: what is in it.
            as_written: whether that is known to be as it was written.
        """
        with self._database.write() as connection:
            _record(connection, tenant, name, path, found, as_written)

    def record_first_seen(self, tenant: Tenant, name: str, path: str, found: Digest) -> bool:
        """The same of a thing from before there were checksums; False, and no row, if it has been deleted.

        Its file may still lie there: rows go first.
        """
        with self._database.write() as connection:
            known = any(
                connection.execute(
                    # Whoever deletes it now is waited for.
                    select(table.c.id).where(table.c.tenant == tenant, table.c.id == name).with_for_update()
                ).first()
                for table in STORED
            )
            if known:
                _record(connection, tenant, name, path, found, as_written=False)
            return known

    def get(self, tenant: Tenant, name: str) -> ChecksumRow | None:
        """The row of a thing; None of one that has none, as from before version 4 or deleted."""
        mine = select(checksums).where(checksums.c.tenant == tenant, checksums.c.id == name)
        found = self._database.rows(mine)
        return cast(ChecksumRow, found[0]) if found else None

    def all(self) -> list[ChecksumRow]:
        """Every tenant's."""
        query = select(checksums).order_by(checksums.c.tenant, checksums.c.path)
        return cast(list[ChecksumRow], self._database.rows(query))

    def damaged(self, tenant: Tenant, name: str, since: float | None) -> None:
        """Say since when a thing holds something else, in s since 1970; None: it is as it was."""
        mine = checksums.c.tenant == tenant, checksums.c.id == name
        with self._database.write() as connection:
            connection.execute(update(checksums).where(*mine).values(damaged=since))

    def delete(self, tenant: Tenant, names: Collection[str]) -> None:
        """Delete the rows of things with these ids."""
        with self._database.write() as connection:
            delete_checksums(connection, tenant, names)


def _record(
    connection: Connection, tenant: Tenant, name: str, path: str, found: Digest, as_written: bool
) -> None:
    now: Plain = {"path": path, "bytes": found.bytes, "sha256": found.sha256, "noted": time.time()}
    now |= {"as_written": as_written, "damaged": None}
    mine = checksums.c.tenant == tenant, checksums.c.id == name
    if not connection.execute(update(checksums).where(*mine).values(**now)).rowcount:
        connection.execute(insert(checksums).values(tenant=tenant, id=name, **now))


def delete_checksums(connection: Connection, tenant: Tenant, names: Collection[str]) -> None:
    """The same in the transaction of the caller."""
    connection.execute(delete(checksums).where(checksums.c.tenant == tenant, checksums.c.id.in_(names)))

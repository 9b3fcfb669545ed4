"""The table of checksums: size and SHA-256 of every stored file when it was written."""

import time
from collections.abc import Collection
from typing import NamedTuple

from sqlalchemy import Delete, delete, func, select, update
from sqlalchemy.orm import Session

from .database import Repository
from .ids import Tenant
from .tables import WITH_FILES, ChecksumRow, Plain


class Digest(NamedTuple):
    """The digest of a file, or of all files in a folder.

    Attributes:
        bytes: total size.
        sha256: hexadecimal; for a folder, of the names and digests of its files.
    """

    bytes: int
    sha256: str


class Checksums(Repository):
    """Checksums by tenant and id."""

    def record(self, tenant: Tenant, name: str, path: str, digest: Digest, *, as_written: bool) -> None:
        """Insert or replace the checksum of an item.

        Args:
            tenant: owner.
            name: id of the item.
            path: below the folder of the tenant, e.g. ``volumes/vol-0123456789abcdef0123.h5``.
            digest: the checksum.
            as_written: whether it was computed when the file was written.
        """
        with self._database.write() as session:
            _record(session, tenant, name, path, digest, as_written)

    def record_first_seen(self, tenant: Tenant, name: str, path: str, digest: Digest) -> bool:
        """Insert the checksum of an item stored before version 4.

        Returns:
            False, without a change, if the item has been deleted; its file may remain for a moment.
        """
        with self._database.write() as session:
            known = any(
                # A concurrent deletion finishes first.
                session.scalar(select(table.id).filter_by(tenant=tenant, id=name).with_for_update())
                for table in WITH_FILES
            )
            if known:
                _record(session, tenant, name, path, digest, as_written=False)
            return known

    def get(self, tenant: Tenant, name: str) -> ChecksumRow | None:
        """The checksum of an item; None if it was stored before version 4 or has been deleted."""
        with self._database.read() as session:
            return session.get(ChecksumRow, (tenant, name))

    def all(self) -> list[ChecksumRow]:
        """The checksums of all tenants."""
        return self._database.rows(select(ChecksumRow).order_by(ChecksumRow.tenant, ChecksumRow.path))

    def count_damaged(self) -> int:
        """The number of items of all tenants that are known to be damaged."""
        return self._database.row(select(func.count()).where(ChecksumRow.damaged.is_not(None))) or 0

    def damaged(self, tenant: Tenant, name: str, since: float | None) -> None:
        """Store since when an item is damaged, s since 1970; None: it is not damaged."""
        self._database.change(update(ChecksumRow).filter_by(tenant=tenant, id=name).values(damaged=since))

    def delete(self, tenant: Tenant, names: Collection[str]) -> None:
        """Delete the checksums of items by id."""
        self._database.change(deletion_of(tenant, names))


def _record(session: Session, tenant: Tenant, name: str, path: str, digest: Digest, as_written: bool) -> None:
    now: Plain = {"path": path, **digest._asdict(), "noted": time.time()}
    # An existing row is replaced.
    session.merge(ChecksumRow(tenant=tenant, id=name, **now, as_written=as_written, damaged=None))


def deletion_of(tenant: Tenant, names: Collection[str]) -> Delete:
    """The statement that deletes the checksums of items by id."""
    return delete(ChecksumRow).where(ChecksumRow.tenant == tenant, ChecksumRow.id.in_(names))

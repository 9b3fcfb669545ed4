"""The rows of uploads that come in pieces; how far one is, the size of its file tells."""

from __future__ import annotations

import time
from typing import Any, cast

from sqlalchemy import ColumnElement, Connection, func, insert, select, update
from sqlalchemy import delete as delete_from

from ..refusals import RateLimited
from . import usage
from .ids import new_id
from .records import Plain, UploadRow
from .schema import uploads
from .stored_tables import TenantTable
from .tenants import Tenant

# Of a tenant, begun and not whole. A client that is done with one ends it; the others expire.
MOST_BEGUN = 100
# After which it is worth another try, s.
AGAIN_S = 60.0


class Uploads(TenantTable[UploadRow]):
    """Uploads from ``receiving`` through ``reading`` to ``done`` or ``refused``.

    A row goes some time after its last change, however it ended.
    """

    table, what = uploads, "upload"

    def add(
        self,
        tenant: Tenant,
        what: str,
        length: int,
        given: Plain,
        metadata: str,
        keep_s: float,
        most_bytes: int,
    ) -> UploadRow:
        """Store a new upload, and reserve the room for it.

        Args:
            tenant: whose it is.
            what: it becomes: ``dataset``, ``volume`` or ``mesh``.
            length: of all of it, bytes.
            given: what the user says of it, as the ingest process wants it.
            metadata: the same as it was sent.
            keep_s: how long it is kept unless something comes, s.
            most_bytes: that the tenant may store.

        Raises:
            QuotaUsedUp: when there is less room than ``length``.
            TooOften: when ``MOST_BEGUN`` of the tenant have been begun and are not whole.
        """
        upload_id, now = new_id("upload"), time.time()
        # Named at once, so that reading it a second time makes the same file.
        result_id = new_id(what)
        with self._database.write() as connection:
            # First, for it lets the uploads of a tenant begin one after the other.
            usage.reserve(connection, tenant, result_id, length, most_bytes)
            _check_begun(connection, tenant)
            connection.execute(
                insert(uploads).values(
                    id=upload_id,
                    tenant=tenant,
                    what=what,
                    result_id=result_id,
                    length=length,
                    given=given,
                    metadata=metadata,
                    state="receiving",
                    created=now,
                    expires=now + keep_s,
                )
            )
        return self.get(tenant, upload_id)

    def unread(self) -> list[UploadRow]:
        """Every tenant's uploads that are whole and not yet read, the oldest first."""
        return self._where(uploads.c.state == "reading")

    def receiving(self) -> list[UploadRow]:
        """Every tenant's uploads that are not whole, as far as was noticed."""
        return self._where(uploads.c.state == "receiving")

    def expired(self, now: float) -> list[UploadRow]:
        """Every tenant's uploads whose time is over, but for those that are being read.

        Args:
            now: s since 1970.
        """
        return self._where(uploads.c.state != "reading", uploads.c.expires < now)

    def keep(self, upload_id: str, keep_s: float) -> float:
        """Something came: keep it that much longer, s. Returns when it goes."""
        expires = time.time() + keep_s
        self._change(upload_id, expires=expires)
        return expires

    def mark_complete(self, upload_id: str) -> None:
        """All of it is there."""
        self._change(upload_id, state="reading")

    def mark_done(self, upload_id: str, keep_s: float) -> None:
        """It has become what it was sent as."""
        self._change(upload_id, state="done", expires=time.time() + keep_s)

    def mark_refused(self, upload_id: str, problem: Plain, keep_s: float) -> None:
        """It cannot be read."""
        self._change(upload_id, released=True, state="refused", problem=problem, expires=time.time() + keep_s)

    def remove(self, upload_id: str) -> None:
        """Forget it."""
        with self._database.write() as connection:
            _release(connection, upload_id)
            connection.execute(delete_from(uploads).where(uploads.c.id == upload_id))

    def _where(self, *conditions: ColumnElement[bool]) -> list[UploadRow]:
        query = select(uploads).where(*conditions).order_by(uploads.c.number)
        return cast(list[UploadRow], self._database.rows(query))

    def _change(self, upload_id: str, *, released: bool = False, **values: Any) -> None:
        with self._database.write() as connection:
            if released:
                _release(connection, upload_id)
            connection.execute(update(uploads).where(uploads.c.id == upload_id).values(**values))


def _check_begun(connection: Connection, tenant: Tenant) -> None:
    begun = uploads.c.tenant == tenant, uploads.c.state == "receiving"
    count = connection.execute(select(func.count()).where(*begun)).scalar_one()
    if count >= MOST_BEGUN:
        accepted = f"fewer than {MOST_BEGUN} of a tenant at a time; end those that are no longer needed"
        raise RateLimited("uploads", f"{count} that are begun and not whole", accepted, AGAIN_S)


def _release(connection: Connection, upload_id: str) -> None:
    """Give up what is reserved for it; what it has become stays stored."""
    query = select(uploads.c.tenant, uploads.c.result_id).where(uploads.c.id == upload_id)
    for row in connection.execute(query):
        usage.release(connection, Tenant(row.tenant), row.result_id)

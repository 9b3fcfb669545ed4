"""The table of resumable uploads; the offset of an upload is the size of its file."""

from __future__ import annotations

import time
from typing import Any

from sqlalchemy import ColumnElement, func, select, update
from sqlalchemy import delete as delete_from
from sqlalchemy.orm import Session

from ..errors import RateLimited
from . import usage
from .accounts import family_of
from .ids import Tenant, new_id
from .stored_tables import TenantTable
from .tables import Plain, UploadRow

# Incomplete uploads of one tenant; they are deleted by the client or expire.
MAX_INCOMPLETE = 100
# Suggested time before the next attempt, s.
AGAIN_S = 60.0
# In place of an id, for uploads to the bucket.
DIRECT = "parts"


class Uploads(TenantTable[UploadRow]):
    """Uploads from ``receiving`` through ``reading`` to ``done`` or ``refused``.

    A row expires some time after its last change.
    """

    table, what = UploadRow, "upload"

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
        """Insert a new upload, and reserve storage for it.

        Args:
            tenant: owner.
            what: type of the result: ``dataset``, ``volume`` or ``mesh``.
            length: size of the complete upload, bytes.
            given: metadata for the ingest process.
            metadata: metadata as sent by the client.
            keep_s: time until it expires without further data, s.
            most_bytes: quota of the tenant.

        Raises:
            QuotaExceeded: when less than ``length`` is available.
            RateLimited: when the tenant has ``MAX_INCOMPLETE`` incomplete uploads.
        """
        upload_id, now = new_id("upload"), time.time()
        # The id of the result is fixed here, so that repeated ingestion writes the same file.
        result_id = new_id(what)
        with self._database.write() as session:
            # First, since it serialises the transactions of one tenant.
            usage.reserve(session, tenant, result_id, length, most_bytes)
            _check_begun(session, tenant)
            session.add(
                UploadRow(
                    id=upload_id,
                    tenant=tenant,
                    what=what,
                    result_id=result_id,
                    length=length,
                    given=given,
                    sent_metadata=metadata,
                    state="receiving",
                    created=now,
                    expires=now + keep_s,
                )
            )
        return self.get(tenant, upload_id)

    def set_direct(self, row: UploadRow) -> UploadRow:
        """Note that the parts of an upload go to the bucket."""
        self._change(row.id, multipart_id=DIRECT)
        row.multipart_id = DIRECT
        return row

    def unread(self) -> list[UploadRow]:
        """Complete uploads of all tenants that wait for ingestion, oldest first."""
        return self._where(UploadRow.state == "reading")

    def ids(self) -> set[str]:
        """The ids of the uploads of all tenants."""
        return set(self._database.rows(select(UploadRow.id)))

    def receiving(self) -> list[UploadRow]:
        """Incomplete uploads of all tenants."""
        return self._where(UploadRow.state == "receiving")

    def expired(self, now: float) -> list[UploadRow]:
        """Expired uploads of all tenants, except those being read.

        Args:
            now: s since 1970.
        """
        return self._where(UploadRow.state != "reading", UploadRow.expires < now)

    def keep(self, upload_id: str, keep_s: float) -> float:
        """Extend the expiry after data was received; returns the new expiry, s since 1970."""
        expires = time.time() + keep_s
        self._change(upload_id, expires=expires)
        return expires

    def mark_complete(self, upload_id: str) -> None:
        """Mark an upload as complete."""
        self._change(upload_id, state="reading")

    def mark_done(self, upload_id: str, keep_s: float) -> None:
        """Mark an upload as ingested."""
        self._change(upload_id, state="done", expires=time.time() + keep_s)

    def mark_rejected(self, upload_id: str, problem: Plain, keep_s: float) -> None:
        """Mark an upload as refused."""
        self._change(upload_id, released=True, state="refused", problem=problem, expires=time.time() + keep_s)

    def remove(self, upload_id: str) -> None:
        """Delete an upload."""
        with self._database.write() as session:
            _release(session, upload_id)
            session.execute(delete_from(UploadRow).where(UploadRow.id == upload_id))

    def _where(self, *conditions: ColumnElement[bool]) -> list[UploadRow]:
        return self._database.rows(select(UploadRow).where(*conditions).order_by(UploadRow.number))

    def _change(self, upload_id: str, *, released: bool = False, **values: Any) -> None:
        with self._database.write() as session:
            if released:
                _release(session, upload_id)
            session.execute(update(UploadRow).where(UploadRow.id == upload_id).values(**values))


def _check_begun(session: Session, tenant: Tenant) -> None:
    begun = UploadRow.tenant.in_(family_of(session, tenant)), UploadRow.state == "receiving"
    count = session.scalars(select(func.count()).where(*begun)).one()
    if count >= MAX_INCOMPLETE:
        accepted = f"fewer than {MAX_INCOMPLETE} incomplete uploads per tenant; delete those no longer needed"
        raise RateLimited("uploads", f"{count} incomplete uploads", accepted, AGAIN_S)


def _release(session: Session, upload_id: str) -> None:
    """Release the reservation of an upload; a stored result is kept."""
    query = select(UploadRow.tenant, UploadRow.result_id).where(UploadRow.id == upload_id)
    for row in session.execute(query):
        usage.release(session, row.tenant, row.result_id)

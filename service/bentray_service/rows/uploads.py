"""The table of resumable uploads; the offset of an upload is the size of its file."""

import time
from typing import Any

from sqlalchemy import delete as delete_from
from sqlalchemy import func, select, update
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

    def in_state(self, state: str) -> list[UploadRow]:
        """Uploads of all tenants in a state, oldest first."""
        return self._database.rows(select(UploadRow).filter_by(state=state).order_by(UploadRow.number))

    def ids(self) -> set[str]:
        """The ids of the uploads of all tenants."""
        return set(self._database.rows(select(UploadRow.id)))

    def expired(self, now: float) -> list[UploadRow]:
        """Expired uploads of all tenants, except those being read.

        Args:
            now: s since 1970.
        """
        expired = UploadRow.state != "reading", UploadRow.expires < now
        return self._database.rows(select(UploadRow).where(*expired).order_by(UploadRow.number))

    def keep(self, upload_id: str, keep_s: float, **values: Any) -> float:
        """Change columns after data was received or read; returns the new expiry, s since 1970."""
        expires = time.time() + keep_s
        self.change(upload_id, expires=expires, **values)
        return expires

    def change(self, upload_id: str, **values: Any) -> None:
        """Change columns of an upload; a refused one releases its reservation."""
        with self._database.write() as session:
            if values.get("state") == "refused":
                _release(session, upload_id)
            session.execute(update(UploadRow).where(UploadRow.id == upload_id).values(**values))

    def remove(self, upload_id: str) -> None:
        """Delete an upload."""
        with self._database.write() as session:
            _release(session, upload_id)
            session.execute(delete_from(UploadRow).where(UploadRow.id == upload_id))


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

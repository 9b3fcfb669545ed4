"""Periodic deletion of expired uploads, old data, old audit files and orphaned files."""

import logging
import time
from collections.abc import Callable

from .access.audit import Audit
from .access.quota import Quota
from .background import BackgroundThread
from .errors import InUse, Locked, UnknownId
from .files.data_folder import Files
from .files.deletion import Deletion
from .files.orphans import Orphans
from .ingest.receive import UploadLocks, remove
from .rows.ages import ExpiryMarks, ObservedTime, StoredItem
from .rows.database import Database
from .rows.ids import Tenant
from .rows.tables import UploadRow
from .rows.uploads import Uploads
from .settings import ServiceSettings

log = logging.getLogger("bentray.housekeeping")

# Interval between clean-ups of the store, s.
TIDY_SECONDS = 3600.0
DAY_S = 86400.0
# Time for which an item must be found expired before it is deleted, s.
AGE_SECONDS = DAY_S
# Larger steps of the system clock are treated as corrections, s.
JUMP_SECONDS = 30.0

UPLOAD, AUDIT = "upload", "audit"
# The audit log belongs to no tenant.
NOBODY = Tenant("")


class Housekeeper(BackgroundThread):
    """Deletes expired items every minute.

    An item is deleted only after it has been found expired for ``AGE_SECONDS`` of observed time (an upload
    for its keeping time), since the system clock may have been wrong for a while.
    """

    idle_s, failure = 60.0, "old data could not be deleted"

    def __init__(
        self,
        settings: ServiceSettings,
        database: Database,
        files: Files,
        quota: Quota,
        hold: UploadLocks,
        orphans: Orphans,
        audit: Audit,
        clocks: Callable[[], tuple[float, float]] = lambda: (time.time(), time.monotonic()),
    ) -> None:
        """Args:
        settings: how long what is kept.
        database, files, orphans, audit: to clean up.
        quota: its reservations are renewed while this process lives.
        hold: locks of uploads.
        clocks: s since 1970, and monotonic seconds.
        """
        super().__init__("housekeeping")
        self._settings = settings
        self._uploads = Uploads(database)
        self._files = files
        self._deletion = Deletion(database, files)
        self._quota = quota
        self._hold = hold
        self._ages = ExpiryMarks(database)
        self._observed = ObservedTime(database, lambda: clocks()[1])
        self._orphans = orphans
        self._audit = audit
        self._upload_wait_s = min(settings.upload_keep_s, AGE_SECONDS)
        self._clocks = clocks
        self._last: tuple[float, float] | None = None
        self._tidied = -TIDY_SECONDS

    def _step(self) -> bool:
        self._quota.renew()
        self.sweep()
        if time.monotonic() - self._tidied >= TIDY_SECONDS:
            self._files.store.tidy(self._leaving.is_set)
            if self._files.store.direct_uploads is not None:
                self._files.store.direct_uploads.tidy(self._uploads.ids)
            self._orphans.sweep(self._leaving.is_set)
            self._tidied = time.monotonic()
        return False

    def sweep(self) -> None:
        """Mark expired items, and delete those that have been expired for long enough."""
        now = self._now()
        keep_days, audit_days = self._settings.keep_days, self._settings.audit_keep_days
        uploads = {StoredItem(row.tenant, UPLOAD, row.id): row for row in self._uploads.expired(now)}
        old = set(uploads)
        if keep_days is not None:
            old |= set(self._deletion.older_than(now - DAY_S * keep_days))
        if audit_days is not None:
            old |= {StoredItem(NOBODY, AUDIT, day) for day in self._audit.days_before(now, audit_days)}
        for aged, seconds in self._ages.mark(old, self._observed.count()).items():
            if aged.what == UPLOAD and seconds >= self._upload_wait_s:
                try:
                    with self._hold(aged.id):
                        self.forget(uploads[aged])
                except Locked:
                    continue
            elif aged.what == AUDIT and seconds >= AGE_SECONDS:
                self._audit.remove(aged.id)
                log.info("deleted the audit log of %s after its keeping time", aged.id)
            elif aged.what != UPLOAD and seconds >= AGE_SECONDS:
                self._delete(aged)

    def _now(self) -> float:
        """The system time, s since 1970; detects corrections of the clock."""
        wall, steady = self._clocks()
        if self._last is not None:
            jump = (wall - self._last[0]) - (steady - self._last[1])
            if abs(jump) > JUMP_SECONDS:
                log.warning(
                    "the system clock was changed by %+.0f s; waiting times of expired items start again",
                    jump,
                )
                self._ages.clear()
        self._last = wall, steady
        return wall

    def _delete(self, stored: StoredItem) -> None:
        try:
            self._deletion.delete(stored)
            log.info("deleted %s of %s after its keeping time", stored.id, stored.tenant)
        except (InUse, UnknownId):
            # Needed by a job, or already deleted.
            pass

    def forget(self, row: UploadRow) -> None:
        """Delete an upload; a stored result is kept.

        Raises:
            InUse: while it is being read.
            StorageUnavailable: when its data cannot be deleted from the bucket now.
        """
        if row.state == "reading":
            raise InUse("upload", f"{row.id}, which is being read", "an upload that is not being read")
        direct = self._files.store.direct_uploads
        if row.multipart_id is not None and direct is not None:
            direct.drop(row)
        remove(self._files.of(row.tenant).upload(row.id))
        self._uploads.remove(row.id)

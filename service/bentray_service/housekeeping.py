"""Periodic deletion of expired uploads, old data, old audit files and orphaned files."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

from sqlalchemy.exc import SQLAlchemyError

from .access.audit import Audit
from .access.quota import Quota
from .errors import DatabaseUnavailable, InUse, Locked, StorageUnavailable, UnknownId
from .files.data_folder import Files
from .files.deletion import Deletion, StoredItem
from .files.direct_uploads import DirectUploads
from .files.orphans import Orphans
from .ingest.append import UploadLocks, remove
from .rows.ages import ExpiredItem, ExpiryMarks, ObservedTime
from .rows.ids import Tenant
from .rows.tables import UploadRow
from .rows.uploads import Uploads

log = logging.getLogger("bentray.housekeeping")

INTERVAL_SECONDS = 60.0
# Interval between clean-ups of the store, s.
TIDY_SECONDS = 3600.0
# Longest wait for a file operation when the service stops, s.
STOP_SECONDS = 30.0
DAY_S = 86400.0
# Time for which an item must be found expired before it is deleted, s.
AGE_SECONDS = DAY_S
# Larger steps of the system clock are treated as corrections, s.
JUMP_SECONDS = 30.0

UPLOAD, AUDIT = "upload", "audit"
# The audit log belongs to no tenant.
NOBODY = Tenant("")


class Housekeeper:
    """Deletes expired items every ``INTERVAL_SECONDS``.

    An item is deleted only after it has been found expired for ``AGE_SECONDS`` of observed time (an upload
    for its keeping time), since the system clock may have been wrong for a while.
    """

    def __init__(
        self,
        uploads: Uploads,
        files: Files,
        deletion: Deletion,
        hold: UploadLocks,
        quota: Quota,
        ages: ExpiryMarks,
        observed: ObservedTime,
        orphans: Orphans,
        keep_days: float | None,
        upload_keep_s: float,
        clocks: Callable[[], tuple[float, float]] = lambda: (time.time(), time.monotonic()),
        audit: Audit | None = None,
        audit_keep_days: float | None = None,
        direct: DirectUploads | None = None,
    ) -> None:
        """Args:
        uploads, files, deletion, orphans: to clean up.
        hold: locks of uploads.
        quota: its reservations are renewed while this process lives.
        ages, observed: marks of expired items, and the observed time.
        keep_days: maximum age of datasets, volumes, meshes and jobs without them; None: unlimited.
        upload_keep_s: keeping time of uploads, s.
        clocks: s since 1970, and monotonic seconds.
        audit, audit_keep_days: the audit log, and the maximum age of its days; None: unlimited.
        direct: uploads in the bucket, if there is one.
        """
        self._uploads = uploads
        self._files = files
        self._deletion = deletion
        self._hold = hold
        self._quota = quota
        self._ages = ages
        self._observed = observed
        self._orphans = orphans
        self._keep_days = keep_days
        self._direct = direct
        self._upload_wait_s = min(upload_keep_s, AGE_SECONDS)
        self._clocks = clocks
        self._audit, self._audit_keep_days = audit, audit_keep_days
        self._last: tuple[float, float] | None = None
        self._leaving = threading.Event()
        self._thread = threading.Thread(target=self._loop, name="housekeeping", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def alive(self) -> bool:
        """Whether the thread is alive."""
        return self._thread.is_alive()

    def stop(self) -> None:
        self._leaving.set()
        self._thread.join(STOP_SECONDS)

    def _loop(self) -> None:
        tidied = -TIDY_SECONDS
        while True:
            try:
                self._quota.renew()
                self.sweep()
                if time.monotonic() - tidied >= TIDY_SECONDS:
                    self._files.store.tidy(self._leaving.is_set)
                    if self._direct is not None:
                        self._direct.tidy(self._uploads.ids)
                    self._orphans.sweep(self._leaving.is_set)
                    tidied = time.monotonic()
            except DatabaseUnavailable as error:
                log.warning("deletion of old data pauses: %s", error)
            except (SQLAlchemyError, OSError, StorageUnavailable):
                log.exception("old data could not be deleted; next attempt in %g s", INTERVAL_SECONDS)
            if self._leaving.wait(INTERVAL_SECONDS):
                return

    def sweep(self) -> None:
        """Mark expired items, and delete those that have been expired for long enough."""
        now = self._now()
        uploads = {ExpiredItem(row.tenant, UPLOAD, row.id): row for row in self._uploads.expired(now)}
        stored: dict[ExpiredItem, StoredItem] = {}
        if self._keep_days is not None:
            old = self._deletion.older_than(now - DAY_S * self._keep_days)
            stored = {ExpiredItem(one.tenant, one.what, one.id): one for one in old}
        days: set[ExpiredItem] = set()
        if self._audit is not None and self._audit_keep_days is not None:
            old_days = self._audit.days_before(now, self._audit_keep_days)
            days = {ExpiredItem(NOBODY, AUDIT, day) for day in old_days}
        for aged, seconds in self._ages.mark({*uploads, *stored, *days}, self._observed.count()).items():
            if aged.what == UPLOAD and seconds >= self._upload_wait_s:
                try:
                    with self._hold(aged.id):
                        self.forget(uploads[aged])
                except Locked:
                    continue
            elif aged.what == AUDIT and seconds >= AGE_SECONDS and self._audit is not None:
                self._audit.remove(aged.id)
                log.info("deleted the audit log of %s after its keeping time", aged.id)
            elif aged in stored and seconds >= AGE_SECONDS:
                self._delete(stored[aged])

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
        if row.multipart_id is not None and self._direct is not None:
            self._direct.drop(row)
        remove(self._files.of(row.tenant).upload(row.id))
        self._uploads.remove(row.id)

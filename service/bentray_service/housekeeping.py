"""The thread that removes what has been kept long enough: uploads that nobody goes on with, and old data."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

from sqlalchemy.exc import SQLAlchemyError

from .access.quota import Quota
from .files.data_folder import Files
from .files.deletion import Deletion, StoredItem
from .files.orphans import Orphans
from .ingest.append import UploadLocks, remove
from .refusals import DatabaseUnavailable, InUse, Locked, StorageUnavailable, UnknownId
from .rows.ages import ExpiredItem, ExpiryMarks
from .rows.observed_time import ObservedTime
from .rows.records import UploadRow
from .rows.uploads import Uploads

log = logging.getLogger("bentray.housekeeping")

INTERVAL_SECONDS = 60.0
# The store is looked through less often, for it may hold much.
TIDY_SECONDS = 3600.0
# How long a large file may take to come to its end there.
STOP_SECONDS = 30.0
DAY_S = 86400.0
# For how long something must be found too old before it goes.
AGE_SECONDS = DAY_S
# Beyond what clocks are corrected by while they run.
JUMP_SECONDS = 30.0

UPLOAD = "upload"


class Housekeeper:
    """Sweeps every ``INTERVAL_SECONDS``.

    What is too old goes only once it has been found so for ``AGE_SECONDS`` of observed time, and an upload
    once more for as long as it is kept: the clock of the machine may have been set wrong for a while.
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
    ) -> None:
        """Args:
        uploads, files, deletion, orphans: what it works on.
        hold: of an upload, so that none vanishes under whoever writes to it.
        quota: whose reservations are renewed as long as this process lives.
        ages, observed: what tells since when something is too old.
        keep_days: how long datasets, volumes and meshes are kept, and jobs that have none of them; None:
            until they are deleted.
        upload_keep_s: how long an upload is kept after something came, s.
        clocks: s since 1970, and seconds that only grow.
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
        self._upload_wait_s = min(upload_keep_s, AGE_SECONDS)
        self._clocks = clocks
        self._last: tuple[float, float] | None = None
        self._leaving = threading.Event()
        self._thread = threading.Thread(target=self._loop, name="housekeeping", daemon=True)

    def start(self) -> None:
        self._thread.start()

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
                    self._orphans.sweep(self._leaving.is_set)
                    tidied = time.monotonic()
            except DatabaseUnavailable as error:
                log.warning("what is old waits: %s", error)
            except (SQLAlchemyError, OSError, StorageUnavailable):
                log.exception("what is old could not be removed; trying again in %g s", INTERVAL_SECONDS)
            if self._leaving.wait(INTERVAL_SECONDS):
                return

    def sweep(self) -> None:
        """Mark what is too old now, and remove what has been so for long enough."""
        now = self._now()
        uploads = {ExpiredItem(row["tenant"], UPLOAD, row["id"]): row for row in self._uploads.expired(now)}
        stored: dict[ExpiredItem, StoredItem] = {}
        if self._keep_days is not None:
            old = self._deletion.older_than(now - DAY_S * self._keep_days)
            stored = {ExpiredItem(one.tenant, one.what, one.id): one for one in old}
        for aged, seconds in self._ages.mark({*uploads, *stored}, self._observed.count()).items():
            if aged.what == UPLOAD and seconds >= self._upload_wait_s:
                try:
                    with self._hold(aged.id):
                        self.forget(uploads[aged])
                except Locked:
                    continue
            elif aged.what != UPLOAD and seconds >= AGE_SECONDS:
                self._delete(stored[aged])

    def _now(self) -> float:
        """The time of day, s since 1970; notices when it has been set."""
        wall, steady = self._clocks()
        if self._last is not None:
            jump = (wall - self._last[0]) - (steady - self._last[1])
            if abs(jump) > JUMP_SECONDS:
                log.warning(
                    "the clock of this machine was set by %+.0f s; what is too old now waits from here on",
                    jump,
                )
                self._ages.clear()
        self._last = wall, steady
        return wall

    def _delete(self, stored: StoredItem) -> None:
        try:
            self._deletion.delete(stored)
            log.info("%s of %s was kept long enough", stored.id, stored.tenant)
        except (InUse, UnknownId):
            # A job still needs it, or it went with what it was made of.
            pass

    def forget(self, row: UploadRow) -> None:
        """Remove an upload; what it has become stays.

        Raises:
            InUse: while it is being read.
        """
        if row["state"] == "reading":
            raise InUse("upload", f"{row['id']}, which is being read", "one that is not")
        remove(self._files.of(row["tenant"]).upload(row["id"]))
        self._uploads.remove(row["id"])

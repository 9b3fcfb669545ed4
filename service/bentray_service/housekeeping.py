"""The thread that removes what has been kept long enough: uploads that nobody goes on with, and old data."""

from __future__ import annotations

import logging
import threading
import time
from typing import Any

from sqlalchemy.exc import SQLAlchemyError

from .ingest.append import Hold
from .refusals import InUse, Locked, StorageAway, UnknownId
from .storage.deletion import Deletion
from .storage.files import Files
from .storage.tenants import Tenant
from .storage.uploads import Uploads

log = logging.getLogger("bentray.housekeeping")

Row = dict[str, Any]

INTERVAL_SECONDS = 60.0
# The store is looked through less often, for it may hold much.
TIDY_SECONDS = 3600.0
# How long a large file may take to come to its end there.
STOP_SECONDS = 30.0
DAY_S = 86400.0


class Housekeeper:
    """Sweeps every ``INTERVAL_SECONDS``."""

    def __init__(
        self, uploads: Uploads, files: Files, deletion: Deletion, hold: Hold, keep_days: float | None
    ) -> None:
        """Args:
        uploads, files, deletion: what it works on.
        hold: of an upload, so that none vanishes under whoever writes to it.
        keep_days: how long datasets, volumes and meshes are kept; None: until they are deleted.
        """
        self._uploads = uploads
        self._files = files
        self._deletion = deletion
        self._hold = hold
        self._keep_days = keep_days
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
                self.sweep()
                if time.monotonic() - tidied >= TIDY_SECONDS:
                    self._files.store.tidy(self._leaving.is_set)
                    tidied = time.monotonic()
            except (SQLAlchemyError, OSError, StorageAway):
                log.exception("what is old could not be removed; trying again in %g s", INTERVAL_SECONDS)
            if self._leaving.wait(INTERVAL_SECONDS):
                return

    def sweep(self) -> None:
        """Remove what is old now."""
        for row in self._uploads.expired():
            try:
                with self._hold(row["id"]):
                    self.forget(row)
            except Locked:
                continue
        if self._keep_days is None:
            return
        for stored in self._deletion.older_than(time.time() - DAY_S * self._keep_days):
            try:
                self._deletion.delete(stored)
                log.info("%s of %s was kept long enough", stored.id, stored.tenant)
            except (InUse, UnknownId):
                # A job still needs it, or it went with what it was made of.
                continue

    def forget(self, row: Row) -> None:
        """Remove an upload; what it has become stays.

        Raises:
            InUse: while it is being read.
        """
        if row["state"] == "reading":
            raise InUse("upload", f"{row['id']}, which is being read", "one that is not")
        self._files.of(Tenant(row["tenant"])).upload(row["id"]).unlink(missing_ok=True)
        self._uploads.remove(row["id"])

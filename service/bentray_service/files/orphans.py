"""Orphaned files, i.e. files without a row in the database: detection and removal."""

import logging
import time
from collections.abc import Callable
from pathlib import Path

from sqlalchemy import select

from ..rows.database import Database
from ..rows.stored_tables import LiveIds
from ..rows.tables import About
from .data_folder import Files, read_stamp, write_stamp
from .tenant_files import KEPT, owner_of, stored_files

log = logging.getLogger("bentray.storage")

# Exports, resumable uploads and quality reports.
BESIDE = ("exports", "uploads", "reports")
# Minimum time for which a file must be orphaned while the service runs, s: new files wait for their row.
SAFE_S = 3600.0


class Orphans:
    """Finds and removes orphans in the data folder; those in a bucket are removed by its store.

    If the folder was used with another database, or with a later state of this one, as after the restore of a
    backup, nothing is removed.
    """

    def __init__(
        self, files: Files, database: Database, *, is_store: bool, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Args:
        files: the data folder.
        database: with the rows.
        keeps: whether the folder is the store, not a cache.
        clock: monotonic seconds.
        """
        self._files = files
        self._database = database
        self._known = LiveIds(database)
        self._kinds = (*KEPT, *BESIDE) if is_store else BESIDE
        self._clock = clock
        self._seen: dict[Path, float] = {}
        self._agreed = False

    def found(self) -> list[Path]:
        """All files without a row; some may be new."""
        lying = list(stored_files(self._files.root, self._kinds))
        # Queried last, so that new files have a row.
        names = self._known.names() if lying else set()
        return [path for path in lying if owner_of(path) not in names]

    def begin(self) -> None:
        """Remove orphans of a dead service; the folder must be locked, before anything is written."""
        orphans = self.found()
        if orphans and not self._used_together():
            log.warning(
                "%d files in %s have no row in this database and are kept, since the folder was last "
                "used with another database or a later state of it; remove them with "
                "`bentray verify --remove-orphans`",
                len(orphans),
                self._files.root,
            )
            return
        self.remove(orphans)
        self._stamp()

    def accept(self) -> None:
        """Remove all orphans at the request of the operator."""
        self.remove(self.found())
        self._stamp()

    def sweep(self, stop: Callable[[], bool]) -> None:
        """Remove files that have been orphaned for ``SAFE_S``; to be called periodically."""
        if not self._agreed:
            return
        found, now = self.found(), self._clock()
        self._seen = {path: self._seen.get(path, now) for path in found}
        self.remove([path for path, since in self._seen.items() if now - since >= SAFE_S and not stop()])

    def remove(self, paths: list[Path]) -> None:
        """Remove files."""
        for path in paths:
            log.warning("removing %s, which has no row", path.relative_to(self._files.root))
            self._files.of(owner_of(path)[0]).drop(path)

    def _stamp(self) -> None:
        """Record that the folder and the database are used together."""
        with self._database.write() as session:
            about = session.scalars(select(About).with_for_update()).one()
            about.begun += 1
        write_stamp(self._files.root, about.database, about.begun)
        self._agreed = True

    def _used_together(self) -> bool:
        with self._database.read() as session:
            about = session.scalars(select(About)).one()
        stamp = read_stamp(self._files.root)
        return stamp is not None and stamp.database == about.database and stamp.begun <= about.begun

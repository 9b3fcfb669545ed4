"""Files that no row knows: left by a death between the file and its row, found and removed."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from sqlalchemy import select, update

from bentray_workers.files.atomic import write_bytes

from ..rows.database import Database
from ..rows.database_id import mark_of
from ..rows.live_ids import LiveIds
from ..rows.schema import about
from ..rows.tenants import Tenant
from .data_folder import Files
from .tenant_files import KEPT

log = logging.getLogger("bentray.storage")

# What is made of things that are kept, and what comes in pieces.
BESIDE = ("exports", "uploads")
# The file that tells with which database the data folder was used last, and after how many starts.
STAMP = "database.json"
# For how long a file must be known to nobody while the service runs, s: it may wait for its row.
SAFE_S = 3600.0


class Orphans:
    """Finds and removes them in the data folder; what lies in a bucket only, its store tidies.

    Where the folder was used with another database, or a later state of this one, as after a dump was
    restored, nothing is removed: what this database does not know may be wanted.
    """

    def __init__(
        self, files: Files, database: Database, *, keeps: bool, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Args:
        files: the data folder.
        database: whose rows count.
        keeps: whether the folder keeps what is stored, and is no cache.
        clock: seconds that only grow.
        """
        self._files = files
        self._database = database
        self._known = LiveIds(database)
        self._kinds = (*KEPT, *BESIDE) if keeps else BESIDE
        self._clock = clock
        self._seen: dict[Path, float] = {}
        self._agreed = False

    def found(self) -> list[Path]:
        """All that no row knows now, some of which may be about to have one."""
        lying = list(self._lying())
        # Asked for last: what came meanwhile has a row.
        names = self._known.names()
        return [path for path in lying if (path.parts[-3], path.name.partition(".")[0]) not in names]

    def begin(self) -> None:
        """Remove what a dead service left; call it once the folder is locked, before anything is written."""
        found = self.found()
        if found and not self._used_together():
            log.warning(
                "%d files in %s have no row in this database, and stay, for the folder was last used with "
                "another database or a later state of it; `bentray verify --remove-orphans` removes them",
                len(found),
                self._files.root,
            )
            return
        self.remove(found)
        self._stamp()

    def accept(self) -> None:
        """Remove all of them, whatever the folder was used with before: somebody asked for it."""
        self.remove(self.found())
        self._stamp()

    def sweep(self, stop: Callable[[], bool]) -> None:
        """Remove what has been without a row for ``SAFE_S``; call it now and then."""
        if not self._agreed:
            return
        found, now = self.found(), self._clock()
        self._seen = {path: self._seen.get(path, now) for path in found}
        self.remove([path for path, since in self._seen.items() if now - since >= SAFE_S and not stop()])

    def remove(self, paths: list[Path]) -> None:
        """Remove them."""
        for path in paths:
            log.warning("%s has no row and is removed", path.relative_to(self._files.root))
            self._files.of(Tenant(path.parts[-3])).drop(path)

    def _stamp(self) -> None:
        """Say that the folder and the database belong together from now on."""
        with self._database.write() as connection:
            begun = int(connection.execute(select(about.c.begun).with_for_update()).scalar_one()) + 1
            connection.execute(update(about).values(begun=begun))
        content = {"database": mark_of(self._database), "begun": begun}
        write_bytes(self._files.root / STAMP, json.dumps(content).encode())
        self._agreed = True

    def _used_together(self) -> bool:
        with self._database.read() as connection:
            begun = int(connection.execute(select(about.c.begun)).scalar_one())
        try:
            content = json.loads((self._files.root / STAMP).read_bytes())
            return bool(content["database"] == mark_of(self._database) and content["begun"] <= begun)
        except (OSError, ValueError, KeyError, TypeError):
            return False

    def _lying(self) -> Iterator[Path]:
        for folder in self._files.root.glob("tenants/*/*"):
            if folder.name in self._kinds and folder.is_dir():
                yield from (path for path in folder.iterdir() if path.suffix != ".partial")

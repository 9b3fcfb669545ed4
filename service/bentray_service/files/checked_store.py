"""A store whose things are checked: what changed on the disk is never read as if it were what was stored."""

from __future__ import annotations

import errno
import logging
import threading
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from itertools import groupby
from operator import itemgetter
from pathlib import Path

from ..refusals import Damaged, DatabaseFull, DatabaseUnavailable, Deleted
from ..rows.checksums import Checksums
from ..rows.digests import Digest, digest_of, stamp_of
from ..rows.records import ChecksumRow
from ..rows.tenants import Tenant
from .store import Store
from .tenant_files import KEPT

log = logging.getLogger("bentray.storage")


class CheckedStore:
    """Notes the checksum of what is published, and compares it the first time that this process reads it.

    What another program writes to later is compared again, for its age or its size tells. What only a scrub
    can find (``bentray verify``) is marked in the database, which is asked each time.
    """

    def __init__(self, inner: Store, root: Path, checksums: Checksums) -> None:
        """Args:
        inner: keeps the things.
        root: the data folder.
        checksums: their rows.
        """
        self._inner = inner
        self._root = root
        self._checksums = checksums
        self._compared: dict[Path, tuple[str, tuple[int, ...]]] = {}
        self._comparing: dict[Path, threading.Lock] = {}

    def publish(self, path: Path) -> None:
        tenant, name, place = self._named(path)
        # Before it is kept: from then on somebody may read it.
        self._checksums.record(tenant, name, place, digest_of(path), as_written=True)
        self._inner.publish(path)

    def fetch(self, path: Path) -> Path:
        """See :class:`Store`.

        Raises:
            Damaged: when it is not what was stored, or not there any more.
            Deleted: when there is none, nor a row of its checksum.
        """
        if path.parent.name not in KEPT:
            # On its way, as the work folder of a job that reads nothing else: it has no checksum.
            return self._inner.fetch(path)
        tenant, name, place = self._named(path)
        row = self._checksums.get(tenant, name)
        try:
            self._inner.fetch(path)
            if row is None:
                self._first_seen(tenant, name, place, path)
            elif row["damaged"] is not None or not self._is_sound(path, row):
                self._mend(path, row)
        except FileNotFoundError as error:
            # Whoever deletes it forgets the checksum first.
            if row is None or self._checksums.get(tenant, name) is None:
                raise Deleted(name) from error
            raise self._damaged(row, "missing") from error
        except OSError as error:
            if error.errno != errno.EIO:
                raise
            unreadable = Damaged(name, "unreadable") if row is None else self._damaged(row, "unreadable")
            raise unreadable from error
        return path

    def remove(self, paths: Collection[Path]) -> None:
        # First, so that whoever misses a file sees that it was to go.
        for tenant, named in groupby(sorted(map(self._named, paths)), key=itemgetter(0)):
            self._checksums.delete(tenant, [name for _, name, _ in named])
        self._inner.remove(paths)
        for path in paths:
            self._compared.pop(path, None)

    def refetch(self, path: Path) -> bool:
        return self._inner.refetch(path)

    def bytes_used(self, folder: Path) -> int:
        return self._inner.bytes_used(folder)

    def fault(self) -> str | None:
        return self._inner.fault()

    def tidy(self, stop: Callable[[], bool]) -> None:
        self._inner.tidy(stop)

    def _is_sound(self, path: Path, row: ChecksumRow) -> bool:
        """Whether a thing holds what its row says; read once, unless it was written anew."""
        with self._alone(path):
            known = row["sha256"], stamp_of(path)
            if self._compared.get(path) == known:
                return True
            if digest_of(path) != _of(row):
                return False
            self._compared[path] = known
            return True

    def _first_seen(self, tenant: Tenant, name: str, place: str, path: Path) -> None:
        """Take a thing from before there were checksums as it is.

        Raises:
            Deleted: when it is being deleted, and only its file is still there.
        """
        with self._alone(path):
            stamp, found = stamp_of(path), digest_of(path)
            self._compared[path] = found.sha256, stamp
        if not self._checksums.record_first_seen(tenant, name, place, found):
            self._compared.pop(path, None)
            raise Deleted(name)
        log.info("%s of %s had no checksum yet; it is taken as it is", name, tenant)

    def _mend(self, path: Path, row: ChecksumRow) -> None:
        """Take another copy in place of a damaged one, if there is one.

        Raises:
            Damaged: where there is none.
        """
        self._compared.pop(path, None)
        whole = self._is_sound(path, row) or (self._inner.refetch(path) and self._is_sound(path, row))
        if not whole:
            found = digest_of(path)
            other = f"{found.bytes} bytes in place of {row['bytes']}"
            raise self._damaged(row, other if found.bytes != row["bytes"] else "other bytes than were stored")
        if row["damaged"] is not None:
            self._checksums.damaged(row["tenant"], row["id"], None)

    def _damaged(self, row: ChecksumRow, found: str) -> Damaged:
        if row["damaged"] is None:
            log.error("%s of %s is damaged: %s", row["id"], row["tenant"], found)
            with suppress(DatabaseUnavailable, DatabaseFull):
                self._checksums.damaged(row["tenant"], row["id"], time.time())
        return Damaged(row["id"], found)

    @contextmanager
    def _alone(self, path: Path) -> Iterator[None]:
        """One thread compares a thing while others that want it wait."""
        lock = self._comparing.setdefault(path, threading.Lock())
        try:
            with lock:
                yield
        finally:
            self._comparing.pop(path, None)

    def _named(self, path: Path) -> tuple[Tenant, str, str]:
        """The tenant, the id and the place of ``tenants/TENANT/KIND/ID.…``."""
        _, tenant, kind, name = path.relative_to(self._root).parts
        return Tenant(tenant), name.partition(".")[0], f"{kind}/{name}"


def _of(row: ChecksumRow) -> Digest:
    return Digest(row["bytes"], row["sha256"])

"""A store that verifies checksums, so that damaged files are never served; verification of all files."""

import errno
import logging
import threading
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import NamedTuple

from ..errors import Damaged, DatabaseFull, DatabaseUnavailable, Deleted
from ..rows.checksums import Checksums
from ..rows.ids import Tenant
from ..rows.tables import ChecksumRow
from .data_folder import Files
from .disk import digest_of, stamp_of
from .orphans import Orphans
from .store import Store
from .tenant_files import KEPT, owner_of, stored_files

log = logging.getLogger("bentray.storage")


class CheckedStore(Store):
    """Stores a checksum with each publication, and verifies it at the first use in this process.

    A file with another size or modification time is verified again. Damage found by ``bentray verify`` is
    marked in the database, which is queried at each use.
    """

    def __init__(self, inner: Store, root: Path, checksums: Checksums) -> None:
        """Args:
        inner: the store.
        root: the data folder.
        checksums: the table of checksums.
        """
        self._inner = inner
        self.direct_uploads = inner.direct_uploads
        self._root = root
        self._checksums = checksums
        self._compared: dict[Path, tuple[str, tuple[int, ...]]] = {}
        self._comparing: dict[Path, threading.Lock] = {}

    def publish(self, path: Path) -> None:
        tenant, name, place = _named(path)
        # Before publication, since it may be read immediately afterwards.
        self._checksums.record(tenant, name, place, digest_of(path), as_written=True)
        self._inner.publish(path)

    def fetch(self, path: Path) -> Path:
        """See :class:`Store`.

        Raises:
            Damaged: when the content differs from the checksum or the file is missing.
            Deleted: when neither the file nor its checksum exists.
        """
        if path.parent.name not in KEPT:
            # Not a stored item, e.g. the work folder of a job.
            return self._inner.fetch(path)
        tenant, name, place = _named(path)
        row = self._checksums.get(tenant, name)
        try:
            self._inner.fetch(path)
            if row is None:
                self._first_seen(tenant, name, place, path)
            elif row.damaged is not None or not self._is_sound(path, row):
                self._restore(path, row)
        except FileNotFoundError as error:
            # A deletion removes the checksum before the file.
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
        # Checksums first, so that readers recognise a missing file as deleted.
        for tenant, named in groupby(sorted(map(_named, paths)), key=itemgetter(0)):
            self._checksums.delete(tenant, [name for _, name, _ in named])
        self._inner.remove(paths)
        for path in paths:
            self._compared.pop(path, None)

    def refetch(self, path: Path) -> bool:
        return self._inner.refetch(path)

    def fault(self) -> str | None:
        return self._inner.fault()

    def tidy(self, stop: Callable[[], bool]) -> None:
        self._inner.tidy(stop)

    def _is_sound(self, path: Path, row: ChecksumRow) -> bool:
        """Whether the content matches the checksum; read again only after a modification."""
        with self._locked(path):
            known = row.sha256, stamp_of(path)
            if self._compared.get(path) == known:
                return True
            if digest_of(path) != (row.bytes, row.sha256):
                return False
            self._compared[path] = known
            return True

    def _first_seen(self, tenant: Tenant, name: str, place: str, path: Path) -> None:
        """Store the current checksum of an item from before version 4.

        Raises:
            Deleted: when it is being deleted.
        """
        with self._locked(path):
            stamp, digest = stamp_of(path), digest_of(path)
            self._compared[path] = digest.sha256, stamp
        if not self._checksums.record_first_seen(tenant, name, place, digest):
            self._compared.pop(path, None)
            raise Deleted(name)
        log.info("stored the first checksum of %s of %s", name, tenant)

    def _restore(self, path: Path, row: ChecksumRow) -> None:
        """Replace a damaged item by another copy, if there is one.

        Raises:
            Damaged: otherwise.
        """
        self._compared.pop(path, None)
        whole = self._is_sound(path, row) or (self._inner.refetch(path) and self._is_sound(path, row))
        if not whole:
            digest = digest_of(path)
            other = f"{digest.bytes} bytes instead of {row.bytes}"
            raise self._damaged(row, other if digest.bytes != row.bytes else "different content")
        if row.damaged is not None:
            self._checksums.damaged(row.tenant, row.id, None)

    def _damaged(self, row: ChecksumRow, found: str) -> Damaged:
        if row.damaged is None:
            log.error("%s of %s is damaged: %s", row.id, row.tenant, found)
            with suppress(DatabaseUnavailable, DatabaseFull):
                self._checksums.damaged(row.tenant, row.id, time.time())
        return Damaged(row.id, found)

    @contextmanager
    def _locked(self, path: Path) -> Iterator[None]:
        """Only one thread verifies an item."""
        lock = self._comparing.setdefault(path, threading.Lock())
        try:
            with lock:
                yield
        finally:
            self._comparing.pop(path, None)


def _named(path: Path) -> tuple[Tenant, str, str]:
    """Tenant, id and path below the folder of the tenant."""
    return *owner_of(path), f"{path.parent.name}/{path.name}"


class Finding(NamedTuple):
    """The result for one stored item.

    Attributes:
        tenant, path: owner, and path below the folder of the tenant.
        state: ``sound``, ``damaged``, ``first seen`` (checksum added) or ``orphan`` (no row).
        found: description of the damage.
    """

    tenant: Tenant
    path: str
    state: str
    found: str = ""


def scrub(files: Files, checksums: Checksums, orphans: Orphans) -> Iterator[Finding]:
    """Verify all stored items; damaged ones are marked and no longer served.

    Args:
        files: the data folder, with a store that has verified nothing yet.
        checksums: the table of checksums.
        orphans: finds files without a row.
    """
    assert isinstance(files.store, CheckedStore)
    rows = {(row.tenant, row.path) for row in checksums.all()}
    unknown = {_named(path)[::2] for path in orphans.found()}
    lying = {_named(path)[::2] for path in stored_files(files.root, KEPT)}
    for tenant, place in sorted(rows | lying | unknown):
        if (tenant, place) in unknown:
            yield Finding(tenant, place, "orphan")
            continue
        try:
            files.store.fetch(files.of(tenant).root / place)
        except Damaged as error:
            yield Finding(tenant, place, "damaged", error.value.partition(", ")[2])
        except Deleted:
            # Deleted by a running service.
            continue
        else:
            yield Finding(tenant, place, "sound" if (tenant, place) in rows else "first seen")

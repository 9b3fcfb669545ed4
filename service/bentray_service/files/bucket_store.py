"""The store that keeps files in a bucket; the data folder is a cache of it."""

from __future__ import annotations

import errno
import logging
import secrets
import threading
import time
from collections.abc import Callable, Collection
from concurrent.futures import Future
from pathlib import Path

from ..refusals import StorageUnavailable
from ..rows.live_ids import LiveIds, Name
from .bucket import Bucket
from .cache import Cache
from .disk import bytes_in
from .packing import metadata_of, packed, unpack
from .tenant_files import KEPT

log = logging.getLogger("bentray.storage")

# The object that tells which database a bucket belongs to.
MARK = "bentray-database"
# How long what was found out of the bucket is believed, s: whether it answers, and how much a tenant has.
FRESH_S = 5.0
SUM_S = 60.0
# After which what no row knows of was forgotten, and is not about to have one, s. Clocks of buckets differ.
FORGOTTEN_S = 86400.0
LEFT_S = 3600.0


class BucketStore:
    """Keeps things in a bucket, each as one object whose key is its path in the data folder; see
    :class:`Store`.

    What lies in the data folder is believed: no name is ever used for another content. What is fetched is
    checked against the SHA-256 that was written beside it.
    """

    def __init__(self, root: Path, bucket: Bucket, mark: str, known: LiveIds, cache_bytes: int) -> None:
        """Args:
        root: the data folder.
        bucket: which holds ``mark`` under ``MARK``.
        mark: of the database.
        known: what it knows of.
        cache_bytes: what things may take in the data folder; those in use may take more.
        """
        self._root = root
        self._bucket = bucket
        self._mark = mark
        self._known = known
        self._cache = Cache(root, cache_bytes)
        self._lock = threading.Lock()
        self._coming: dict[Path, Future[None]] = {}
        self._sums: dict[Path, tuple[float, int]] = {}
        self._asking = threading.Lock()
        self._asked = -FRESH_S
        self._fault: str | None = None

    def publish(self, path: Path) -> None:
        key = self._key(path)
        with packed(path, self._root / "scratch") as whole:
            told = metadata_of(path, whole)
            held = self._bucket.metadata(key)
            if held is None or held.get("sha256") != told["sha256"]:
                self._bucket.put(whole, key, told)
                self._count(path, whole.stat().st_size)
        self._cache.use(path)
        self._make_room(0)

    def fetch(self, path: Path) -> Path:
        if self._cache.use(path):
            return path
        with self._lock:
            coming = self._coming.get(path)
            if mine := coming is None:
                coming = self._coming[path] = Future()
        if not mine:
            # Somebody fetches it already.
            coming.result()
            return path
        try:
            if not self._cache.use(path):
                self._fetch(path)
        except BaseException as error:
            coming.set_exception(error)
            raise
        else:
            coming.set_result(None)
        finally:
            with self._lock:
                del self._coming[path]
        return path

    def refetch(self, path: Path) -> bool:
        self._cache.clear([path])
        self.fetch(path)
        return True

    def remove(self, paths: Collection[Path]) -> None:
        if fault := self.fault():
            raise StorageUnavailable(fault)
        # In this order, so that who publishes what lies there by itself can see that it is gone.
        self._cache.clear(paths)
        self._bucket.remove([self._key(path) for path in paths])
        with self._lock:
            for path in paths:
                self._sums.pop(path.parents[1], None)

    def bytes_used(self, folder: Path) -> int:
        now = time.monotonic()
        with self._lock:
            asked, kept = self._sums.get(folder, (-SUM_S, 0))
        if now - asked >= SUM_S:
            kept = sum(one.size for one in self._bucket.listed(f"{self._key(folder)}/"))
            with self._lock:
                self._sums[folder] = now, kept
        return kept + sum(bytes_in(inside) for inside in folder.iterdir() if inside.name not in KEPT)

    def fault(self) -> str | None:
        with self._asking:
            if time.monotonic() - self._asked >= FRESH_S:
                self._fault, self._asked = self._probe(), time.monotonic()
            return self._fault

    def tidy(self, stop: Callable[[], bool]) -> None:
        """Remove what was forgotten, and publish what lies in the data folder only, as from before there was
        a bucket."""
        held = {one.key: one.changed for one in self._bucket.listed("tenants/")}
        lying = list(self._cache.stored_paths())
        # Asked for last: what came meanwhile has a row, or is young.
        names, now = self._known.names(), time.time()
        unknown = (key for key in held if _name(key) not in names)
        old = [key for key in unknown if now - held[key] > FORGOTTEN_S]
        if old:
            log.warning("%d objects of which the database knows nothing are removed", len(old))
            self._bucket.remove(old)
        for path in lying:
            if stop():
                return
            key = self._key(path)
            try:
                if _name(key) not in names:
                    if now - path.stat().st_ctime > LEFT_S:
                        self._cache.clear([path])
                elif path.parent.name in KEPT and key not in held:
                    self.publish(path)
                    if not path.exists():
                        self._bucket.remove([key])
            except FileNotFoundError:
                continue

    def _fetch(self, path: Path) -> None:
        key = self._key(path)
        told = self._bucket.metadata(key)
        if told is None:
            if fault := self._probe():
                raise StorageUnavailable(fault)
            raise FileNotFoundError(errno.ENOENT, "it is not in the bucket", key)
        self._make_room(int(told["size"]))
        whole = self._root / "scratch" / f"{secrets.token_hex(8)}.coming"
        try:
            self._bucket.get(key, whole)
            unpack(whole, told, path)
        except ValueError as error:
            raise OSError(errno.EIO, str(error), key) from error
        finally:
            whole.unlink(missing_ok=True)
        self._cache.use(path)

    def _make_room(self, wanted: int) -> None:
        self._cache.make_room(
            wanted, self._known.needed, lambda path: self._bucket.metadata(self._key(path)) is not None
        )

    def _count(self, path: Path, size: int) -> None:
        with self._lock:
            if (found := self._sums.get(path.parents[1])) is not None:
                self._sums[path.parents[1]] = found[0], found[1] + size

    def _probe(self) -> str | None:
        try:
            told = self._bucket.metadata(MARK)
        except StorageUnavailable as error:
            return error.value
        if told is None or told.get("database") != self._mark:
            return "the bucket is not there, or not the one of this database any more"
        return None

    def _key(self, path: Path) -> str:
        return path.relative_to(self._root).as_posix()


def _name(key: str) -> Name:
    """The tenant and the id of ``tenants/TENANT/KIND/ID.…``."""
    _, tenant, _, name = key.split("/", 3)
    return tenant, name.partition(".")[0]

"""The store that the settings select: the data folder, or a bucket with the data folder as a cache of it."""

import errno
import logging
import os
import secrets
import threading
import time
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Future
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from bentray_kernels.errors import InvalidInput

from ..errors import StorageUnavailable
from ..rows.database import Database, mark_of
from ..rows.stored_tables import LiveIds
from .bucket import Bucket
from .direct_uploads import DirectUploads
from .disk import bytes_in, metadata_of, packed, remove_path, unpack
from .store import Store
from .tenant_files import KEPT, owner_of, stored_files

# Evicted together with their volume or dataset.
MADE_OF_THEM = ("exports", "reports")
# Items used within this time are not evicted, s; longer than rendering or the start of a download takes.
RECENT_S = 300.0

log = logging.getLogger("bentray.storage")

# The object with the id of the database that uses the bucket.
MARK = "bentray-database"
# Caching time of the availability of the bucket, s.
FRESH_S = 5.0
# Minimum age of orphaned objects and cached files before deletion, s; the clocks of buckets differ.
FORGOTTEN_S = 86400.0
LEFT_S = 3600.0
FIELD = "BENTRAY_STORAGE_URL"


@dataclass
class CachedItem:
    """An item with its exports; ``used`` is the time of last use, s since 1970."""

    paths: list[Path] = field(default_factory=list)
    size: int = 0
    used: float = 0.0


class Cache:
    """The folders ``KEPT`` and ``MADE_OF_THEM`` of all tenants below ``root``.

    The time of last use of an item is the access time of its file or folder.
    """

    def __init__(self, root: Path, most_bytes: int) -> None:
        self._root = root
        self._most_bytes = most_bytes
        self._lock = threading.Lock()

    def use(self, path: Path) -> bool:
        """Whether an item is cached; if so, its time of last use is set to now."""
        with self._lock:
            try:
                written = path.stat().st_mtime_ns
            except FileNotFoundError:
                return False
            os.utime(path, ns=(time.time_ns(), written))
            return True

    def make_room(
        self, size: int, needed: Callable[[], Collection[str]], restorable: Callable[[Path], bool]
    ) -> None:
        """Evict the least recently used items until ``size`` bytes fit.

        Args:
            size: size of a new item, bytes.
            needed: returns the ids that unfinished jobs need; called only if something must be evicted.
            restorable: whether an item can be downloaded again.
        """
        things = self._things()
        total = sum(thing.size for thing in things.values()) + size
        if total <= self._most_bytes:
            return
        needing = needed()
        for (_, name), thing in sorted(things.items(), key=lambda one: one[1].used):
            if total <= self._most_bytes or thing.used > time.time() - RECENT_S:
                return
            if name in needing or not all(
                restorable(path) for path in thing.paths if path.parent.name in KEPT
            ):
                continue
            if self._drop(thing):
                total -= thing.size

    def clear(self, paths: Collection[Path]) -> None:
        """Delete cached items, each atomically."""
        for path in paths:
            gone = self._root / "scratch" / f"{secrets.token_hex(8)}.gone"
            try:
                path.replace(gone)
            except FileNotFoundError:
                continue
            remove_path(gone)

    def stored_paths(self) -> Iterator[Path]:
        """All complete files and folders."""
        return stored_files(self._root, (*KEPT, *MADE_OF_THEM))

    def _drop(self, thing: CachedItem) -> bool:
        """Evict an item, unless it was used in the meantime."""
        with self._lock:
            for path in thing.paths:
                if path.exists() and path.stat().st_atime > thing.used:
                    return False
            self.clear(thing.paths)
        return True

    def _things(self) -> dict[tuple[str, str], CachedItem]:
        """Cached items by tenant and id."""
        items: dict[tuple[str, str], CachedItem] = {}
        for path in self.stored_paths():
            try:
                state = path.stat()
            except FileNotFoundError:
                continue
            thing = items.setdefault(owner_of(path), CachedItem())
            thing.paths.append(path)
            thing.size += bytes_in(path) if path.is_dir() else state.st_size
            thing.used = max(thing.used, state.st_atime)
        return items


class BucketStore(Store):
    """Keeps each item as one object whose key is its path in the data folder.

    A cached file is always valid, since names are never reused for other content. Downloads are verified
    against the SHA-256 in the metadata of the object.
    """

    def __init__(self, root: Path, bucket: Bucket, mark: str, known: LiveIds, cache_bytes: int) -> None:
        """Args:
        root: the data folder.
        bucket: with ``mark`` under ``MARK``.
        mark: id of the database.
        known: ids in use.
        cache_bytes: maximum size of the cache; files in use may exceed it.
        """
        self._root = root
        self._bucket = bucket
        # A PUT to Azure needs a header beside the address.
        self.direct_uploads = None if bucket.url.startswith("az:") else DirectUploads(bucket)
        self._mark = mark
        self._known = known
        self._cache = Cache(root, cache_bytes)
        self._lock = threading.Lock()
        self._coming: dict[Path, Future[None]] = {}
        self._asking = threading.Lock()
        self._probed_at = -FRESH_S
        self._fault: str | None = None

    def publish(self, path: Path) -> None:
        key = self._key(path)
        with packed(path, self._root / "scratch") as whole:
            metadata = metadata_of(path, whole)
            held = self._bucket.metadata(key)
            if held is None or held.get("sha256") != metadata["sha256"]:
                self._bucket.put(whole, key, metadata)
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
            # Another thread is downloading it.
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
        # Cache first, so that a concurrent publication notices the deletion.
        self._cache.clear(paths)
        self._bucket.remove([self._key(path) for path in paths])

    def fault(self) -> str | None:
        with self._asking:
            if time.monotonic() - self._probed_at >= FRESH_S:
                self._fault, self._probed_at = self._probe(), time.monotonic()
            return self._fault

    def tidy(self, stop: Callable[[], bool]) -> None:
        """Delete orphaned objects and cached files, and publish files that are in the data folder only."""
        held = {one["path"]: one["last_modified"].timestamp() for one in self._bucket.listed("tenants/")}
        lying = list(self._cache.stored_paths())
        # Queried last, so that files created meanwhile have a row or are new.
        names, now = self._known.names(), time.time()
        unknown = (key for key in held if owner_of(PurePosixPath(key)) not in names)
        old = [key for key in unknown if now - held[key] > FORGOTTEN_S]
        if old:
            log.warning("deleting %d objects without a row in the database", len(old))
            self._bucket.remove(old)
        for path in lying:
            if stop():
                return
            key = self._key(path)
            try:
                if owner_of(path) not in names:
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
        metadata = self._bucket.metadata(key)
        if metadata is None:
            if fault := self._probe():
                raise StorageUnavailable(fault)
            raise FileNotFoundError(errno.ENOENT, "not in the bucket", key)
        self._make_room(int(metadata["size"]))
        whole = self._root / "scratch" / f"{secrets.token_hex(8)}.coming"
        try:
            self._bucket.get(key, whole)
            unpack(whole, metadata, path)
        except ValueError as error:
            raise OSError(errno.EIO, str(error), key) from error
        finally:
            whole.unlink(missing_ok=True)
        self._cache.use(path)

    def _make_room(self, size: int) -> None:
        self._cache.make_room(
            size, self._known.needed, lambda path: self._bucket.metadata(self._key(path)) is not None
        )

    def _probe(self) -> str | None:
        try:
            metadata = self._bucket.metadata(MARK)
        except StorageUnavailable as error:
            return error.value
        if metadata is None or metadata.get("database") != self._mark:
            return "the bucket does not exist, or belongs to another database"
        return None

    def _key(self, path: Path) -> str:
        return path.relative_to(self._root).as_posix()


def open_store(
    url: str | None, root: Path, database: Database, cache_bytes: int, public_endpoint: str | None = None
) -> Store:
    """Open the store of a service.

    Args:
        url: ``s3://bucket/prefix``, or ``gs://`` or ``az://``; None for the data folder.
        root: the data folder.
        database: with the rows of the stored items.
        cache_bytes: see ``BucketStore``.
        public_endpoint: see ``Bucket``.

    Raises:
        InvalidInput: when the bucket is not readable and writable, or belongs to another database.
    """
    if url is None:
        return Store()
    mark = mark_of(database)
    try:
        bucket = Bucket(url, public_endpoint)
        metadata = bucket.metadata(MARK)
        if metadata is None and next(bucket.listed(), None) is not None:
            raise InvalidInput(FIELD, f"{url}, which contains other objects", "an unused prefix")
        if metadata is not None and metadata.get("database") != mark:
            found = f"{url}, used by another database than BENTRAY_DATABASE_URL"
            accepted = "the database that it was used with (see `bentray restore`), or a separate prefix"
            raise InvalidInput(FIELD, found, accepted)
        # Written even if present, to verify write access.
        bucket.put_metadata(MARK, {"database": mark})
    except StorageUnavailable as error:
        found = f"{url} ({error.value})"
        raise InvalidInput(FIELD, found, "a readable and writable bucket") from error
    return BucketStore(root, bucket, mark, LiveIds(database), cache_bytes)

"""The data folder as a cache with eviction of the least recently used items."""

from __future__ import annotations

import os
import secrets
import threading
import time
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from .disk import bytes_in, remove_path
from .tenant_files import KEPT, owner_of, stored_files

# Evicted together with their volume or dataset.
MADE_OF_THEM = ("exports", "reports")
# Items used within this time are not evicted, s; longer than rendering or the start of a download takes.
RECENT_S = 300.0


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

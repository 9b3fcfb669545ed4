"""The data folder as a cache: what was used last, and how what was used longest ago makes room."""

from __future__ import annotations

import os
import secrets
import shutil
import threading
import time
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from .disk import bytes_in
from .tenant_files import KEPT

# What can be made of the things that are kept goes with them.
MADE_OF_THEM = ("exports",)
# How long nothing goes that was asked for: longer than any picture takes, and than a download needs to begin.
RECENT_S = 300.0


@dataclass
class CachedItem:
    """A thing with all that was made of it; ``used`` is when it was last asked for, s since 1970."""

    paths: list[Path] = field(default_factory=list)
    size: int = 0
    used: float = 0.0


class Cache:
    """What lies in the folders ``KEPT`` and ``MADE_OF_THEM`` of every tenant below ``root``.

    When a thing was last used is the access time of its file or folder, which outlives the service.
    """

    def __init__(self, root: Path, most_bytes: int) -> None:
        self._root = root
        self._most_bytes = most_bytes
        self._lock = threading.Lock()

    def use(self, path: Path) -> bool:
        """Whether a thing lies there; it stays for the next ``RECENT_S`` then."""
        with self._lock:
            try:
                written = path.stat().st_mtime_ns
            except FileNotFoundError:
                return False
            os.utime(path, ns=(time.time_ns(), written))
            return True

    def make_room(
        self, wanted: int, needed: Callable[[], Collection[str]], kept: Callable[[Path], bool]
    ) -> None:
        """Remove things, those used longest ago first, until ``wanted`` bytes fit.

        Args:
            wanted: bytes that are to come.
            needed: the ids of all that unfinished jobs need; asked for only when something has to go.
            kept: whether a thing can be had again.
        """
        things = self._things()
        total = sum(thing.size for thing in things.values()) + wanted
        if total <= self._most_bytes:
            return
        needing = needed()
        for (_, name), thing in sorted(things.items(), key=lambda one: one[1].used):
            if total <= self._most_bytes or thing.used > time.time() - RECENT_S:
                return
            if name in needing or not all(kept(path) for path in thing.paths if path.parent.name in KEPT):
                continue
            if self._drop(thing):
                total -= thing.size

    def clear(self, paths: Collection[Path]) -> None:
        """Remove what lies there, each thing at once."""
        for path in paths:
            gone = self._root / "scratch" / f"{secrets.token_hex(8)}.gone"
            try:
                path.replace(gone)
            except FileNotFoundError:
                continue
            if gone.is_dir():
                shutil.rmtree(gone)
            else:
                gone.unlink()

    def stored_paths(self) -> Iterator[Path]:
        """Every file or folder that is whole."""
        for folder in self._root.glob("tenants/*/*"):
            if folder.name in (*KEPT, *MADE_OF_THEM):
                yield from (path for path in folder.iterdir() if path.suffix != ".partial")

    def _drop(self, thing: CachedItem) -> bool:
        """Remove a thing, unless somebody asked for it meanwhile."""
        with self._lock:
            for path in thing.paths:
                if path.exists() and path.stat().st_atime > thing.used:
                    return False
            self.clear(thing.paths)
        return True

    def _things(self) -> dict[tuple[str, str], CachedItem]:
        """By tenant and id."""
        found: dict[tuple[str, str], CachedItem] = {}
        for path in self.stored_paths():
            try:
                state = path.stat()
            except FileNotFoundError:
                continue
            thing = found.setdefault((path.parts[-3], path.name.partition(".")[0]), CachedItem())
            thing.paths.append(path)
            thing.size += bytes_in(path) if path.is_dir() else state.st_size
            thing.used = max(thing.used, state.st_atime)
        return found

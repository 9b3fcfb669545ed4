"""The default store: the data folder itself."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Collection
from pathlib import Path

from bentray_workers.files.atomic import sync

from .direct_uploads import DirectUploads
from .disk import remove_path


class LocalStore:
    """Keeps files in place; see :class:`Store`."""

    direct_uploads: DirectUploads | None = None

    def publish(self, path: Path) -> None:
        """Make the name durable; the content is made durable by the writer."""
        sync(path.parent)

    def fetch(self, path: Path) -> Path:
        if not path.exists():
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
        return path

    def refetch(self, path: Path) -> bool:
        return False

    def remove(self, paths: Collection[Path]) -> None:
        for path in paths:
            remove_path(path)

    def fault(self) -> str | None:
        return None

    def tidy(self, stop: Callable[[], bool]) -> None:
        """Nothing to do: there are no copies."""

"""The store, which keeps the files of tenants permanently: the data folder itself, and its interface."""

import errno
import os
from collections.abc import Callable, Collection
from pathlib import Path

from bentray_workers.files.atomic import sync

from .direct_uploads import DirectUploads
from .disk import remove_path


class Store:
    """Keeps items: datasets, volumes, animations, meshes and geometry fields, each a file or a folder.

    An item is identified by its path in the data folder, see :class:`TenantFiles`; it is complete or absent.
    This one keeps items where they are; subclasses keep them elsewhere, or check them.

    Attributes:
        direct_uploads: uploads of clients to the store; None if it accepts none.
    """

    direct_uploads: DirectUploads | None = None

    def publish(self, path: Path) -> None:
        """Keep the item at ``path`` permanently; to be called before its row is inserted.

        Raises:
            StorageUnavailable: when it cannot be kept now; the file at ``path`` remains.
        """
        # The writer made the content durable, this the name.
        sync(path.parent)

    def fetch(self, path: Path) -> Path:
        """Make an item available at ``path`` for the next minutes, and return the path.

        Raises:
            FileNotFoundError: when it does not exist.
            StorageUnavailable: when it cannot be fetched now.
        """
        if not path.exists():
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
        return path

    def refetch(self, path: Path) -> bool:
        """Replace a damaged file at ``path`` by another copy; returns whether there is one.

        Raises:
            FileNotFoundError, StorageUnavailable: as ``fetch``.
        """
        return False

    def remove(self, paths: Collection[Path]) -> None:
        """Delete items; missing ones are ignored.

        Raises:
            StorageUnavailable: when they cannot be deleted now.
        """
        for path in paths:
            remove_path(path)

    def fault(self) -> str | None:
        """Why the store is unavailable, or None."""
        return None

    def tidy(self, stop: Callable[[], bool]) -> None:
        """Remove inconsistencies with the database, until ``stop`` returns True.

        Raises:
            StorageUnavailable: when that is not possible now.
        """

"""The interface of stores, which keep the files of tenants permanently."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Protocol

from .direct_uploads import DirectUploads


class Store(Protocol):
    """Keeps items: datasets, volumes, animations, meshes and geometry fields, each a file or a folder.

    An item is identified by its path in the data folder, see :class:`TenantFiles`; it is complete or absent.
    """

    @property
    def direct_uploads(self) -> DirectUploads | None:
        """Uploads of clients to the store; None if it accepts none."""

    def publish(self, path: Path) -> None:
        """Keep the item at ``path`` permanently; to be called before its row is inserted.

        Raises:
            StorageUnavailable: when it cannot be kept now; the file at ``path`` remains.
        """

    def fetch(self, path: Path) -> Path:
        """Make an item available at ``path`` for the next minutes, and return the path.

        Raises:
            FileNotFoundError: when it does not exist.
            StorageUnavailable: when it cannot be fetched now.
        """

    def refetch(self, path: Path) -> bool:
        """Replace a damaged file at ``path`` by another copy; returns whether there is one.

        Raises:
            FileNotFoundError, StorageUnavailable: as ``fetch``.
        """

    def remove(self, paths: Collection[Path]) -> None:
        """Delete items; missing ones are ignored.

        Raises:
            StorageUnavailable: when they cannot be deleted now.
        """

    def fault(self) -> str | None:
        """Why the store is unavailable, or None."""

    def tidy(self, stop: Callable[[], bool]) -> None:
        """Remove inconsistencies with the database, until ``stop`` returns True.

        Raises:
            StorageUnavailable: when that is not possible now.
        """

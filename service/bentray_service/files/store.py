"""What keeps the files of tenants for good: one interface, whether they stay in the data folder or not."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Protocol


class Store(Protocol):
    """Keeps things: datasets, volumes, animations, meshes and geometry fields, each a file or a folder.

    A thing is named by its path in the data folder, which :class:`TenantFiles` makes of a tenant and checked
    ids; what is kept of it is whole or not there.
    """

    def publish(self, path: Path) -> None:
        """Keep what lies at ``path`` for good, before a row says that it is there.

        Raises:
            StorageAway: when it cannot be kept now; what lies there stays.
        """

    def fetch(self, path: Path) -> Path:
        """Let a thing lie at ``path``, to be read in the minutes that follow, and return the path.

        Raises:
            FileNotFoundError: when there is none.
            StorageAway: when it cannot be fetched now.
        """

    def refetch(self, path: Path) -> bool:
        """Let another copy lie at ``path`` in place of one that is damaged; whether there is one.

        Raises:
            FileNotFoundError, StorageAway: as ``fetch``.
        """

    def remove(self, paths: Collection[Path]) -> None:
        """Remove things everywhere; those that are not there are passed over.

        Raises:
            StorageAway: when they cannot be removed now.
        """

    def bytes_used(self, folder: Path) -> int:
        """What the folder of a tenant takes, wherever it is kept; about a minute old at most.

        Raises:
            StorageAway: when that cannot be told now.
        """

    def fault(self) -> str | None:
        """Why nothing can be kept or fetched now, in words, or None; may be asked at any time."""

    def tidy(self, stop: Callable[[], bool]) -> None:
        """Bring what is kept into line with the database, a little at a time until ``stop`` says so.

        Raises:
            StorageAway: when that cannot be done now.
        """

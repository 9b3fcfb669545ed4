"""Uploads that clients send straight to the bucket, each part an object, by presigned addresses."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import StorageUnavailable
from ..rows.tables import UploadRow

if TYPE_CHECKING:
    from .bucket import Bucket

log = logging.getLogger("bentray.storage")

# Beside the stored items, which are under "tenants/"; a folder for each upload, named by its id.
FOLDER = "direct/"
# Size of a part, larger for files of more than MAX_PARTS parts.
PART_BYTES = 16 * 2**20
MAX_PARTS = 10_000
# Time for which an address of a part is valid, s.
VALID_S = 3600.0
# Minimum age of data without an upload before deletion, s.
FORGOTTEN_S = 86400.0


class DirectUploads:
    """The data of direct uploads in a bucket; it is fetched for the ingest process, which alone reads it."""

    def __init__(self, bucket: Bucket) -> None:
        self._bucket = bucket

    def part_url(self, row: UploadRow, number: int) -> str:
        """Address to which a client sends part ``number`` (from 1) with PUT."""
        left_s = max(1.0, min(VALID_S, row.expires - time.time()))
        return self._bucket.put_url(_key(row, number), int(left_s))

    def received(self, row: UploadRow) -> dict[int, int]:
        """Sizes of the parts in the bucket by number, in their order."""
        held = sorted(self._bucket.listed(_folder(row)), key=lambda piece: piece["path"])
        return {int(piece["path"].rpartition("/")[2]): piece["size"] for piece in held}

    def fetch(self, row: UploadRow, path: Path) -> None:
        """Download all parts to ``path``, one after the other.

        Raises:
            FileNotFoundError: when one does not exist.
            StorageUnavailable: when they cannot be fetched now.
        """
        path.write_bytes(b"")
        for number, _ in enumerate(part_sizes(row.length), 1):
            self._bucket.get(_key(row, number), path, "ab")

    def drop(self, row: UploadRow) -> None:
        """Delete all parts.

        Raises:
            StorageUnavailable: when they cannot be deleted now.
        """
        self._bucket.remove([piece["path"] for piece in self._bucket.listed(_folder(row))])

    def drop_later(self, row: UploadRow) -> None:
        """Delete all parts; if that is not possible now, ``tidy`` does it."""
        try:
            self.drop(row)
        except StorageUnavailable as error:
            log.warning("data of %s remains in the bucket for a day: %s", row.id, error)

    def tidy(self, ids: Callable[[], Collection[str]]) -> None:
        """Delete old data of uploads that are not among ``ids()``, from services that died."""
        held = list(self._bucket.listed(FOLDER))
        # Queried last: the row of an upload is older than its data.
        current, now = ids(), time.time()
        unknown = [piece for piece in held if piece["path"].split("/")[1] not in current]
        old = [piece for piece in unknown if now - piece["last_modified"].timestamp() > FORGOTTEN_S]
        self._bucket.remove([piece["path"] for piece in old])


def part_sizes(length: int) -> list[int]:
    """Sizes of the parts of a file, bytes."""
    size = max(PART_BYTES, math.ceil(length / MAX_PARTS))
    return [min(size, length - begin) for begin in range(0, length, size)]


def _folder(row: UploadRow) -> str:
    return f"{FOLDER}{row.id}/"


def _key(row: UploadRow, number: int) -> str:
    return f"{_folder(row)}{number:05d}"

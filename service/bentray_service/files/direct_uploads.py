"""Uploads that clients send straight to the bucket, in parts, by presigned addresses."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import StorageUnavailable
from ..rows.typed_rows import UploadRow

if TYPE_CHECKING:
    from .bucket import Bucket

log = logging.getLogger("bentray.storage")

# Beside the stored items, which are under "tenants/".
FOLDER = "direct/"
# Size of a part, larger for files of more than MAX_PARTS parts; S3 accepts 5 MiB to 5 GiB.
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

    def begin(self, upload_id: str) -> str:
        """Begin the upload of an object in parts; returns its id in the bucket."""
        return self._bucket.begin_parts(_key(upload_id))

    def part_url(self, row: UploadRow, number: int) -> str:
        """Address to which a client sends a part with PUT; the size of the part is signed, too.

        Args:
            row: of the upload.
            number: of the part, from 1.
        """
        left_s = max(1.0, min(VALID_S, row["expires"] - time.time()))
        size = part_sizes(row["length"])[number - 1]
        return self._bucket.part_url(_key(row["id"]), row["multipart_id"] or "", number, size, int(left_s))

    def received(self, row: UploadRow) -> dict[int, int]:
        """Sizes of the parts in the bucket by number; all of them, if the object is complete."""
        found = self._bucket.parts(_key(row["id"]), row["multipart_id"] or "")
        if found is not None:
            return {number: size for number, (_, size) in found.items()}
        metadata = self._bucket.metadata(_key(row["id"]))
        whole = metadata is not None and int(metadata["size"]) == row["length"]
        return dict(enumerate(part_sizes(row["length"]), 1)) if whole else {}

    def complete(self, row: UploadRow) -> None:
        """Assemble the parts; harmless if that was done before."""
        found = self._bucket.parts(_key(row["id"]), row["multipart_id"] or "")
        if found is not None:
            tags = {number: tag for number, (tag, _) in found.items()}
            self._bucket.complete_parts(_key(row["id"]), row["multipart_id"] or "", tags)

    def fetch(self, row: UploadRow, path: Path) -> None:
        """Download the object to ``path``.

        Raises:
            FileNotFoundError: when it does not exist.
            StorageUnavailable: when it cannot be fetched now.
        """
        self._bucket.get(_key(row["id"]), path)

    def drop(self, row: UploadRow) -> None:
        """Delete parts and object.

        Raises:
            StorageUnavailable: when they cannot be deleted now.
        """
        self._bucket.abort_parts(_key(row["id"]), row["multipart_id"] or "")
        self._bucket.remove([_key(row["id"])])

    def tidy(self, ids: Callable[[], Collection[str]]) -> None:
        """Delete old data of uploads that are not among ``ids()``, from services that died."""
        begun, whole = self._bucket.begun_parts(FOLDER), list(self._bucket.listed(FOLDER))
        # Queried last: the row of an upload is older than its data.
        known, now = ids(), time.time()
        for key, multipart_id, since in begun:
            if key.removeprefix(FOLDER) not in known and now - since > FORGOTTEN_S:
                self._bucket.abort_parts(key, multipart_id)
        for one in whole:
            if one.key.removeprefix(FOLDER) not in known and now - one.changed > FORGOTTEN_S:
                self._bucket.remove([one.key])

    def drop_later(self, row: UploadRow) -> None:
        """Delete parts and object; if that is not possible now, ``tidy`` does it."""
        try:
            self.drop(row)
        except StorageUnavailable as error:
            log.warning("data of %s remains in the bucket for a day: %s", row["id"], error)


def part_sizes(length: int) -> list[int]:
    """Sizes of the parts of a file, bytes."""
    size = max(PART_BYTES, math.ceil(length / MAX_PARTS))
    return [min(size, length - begin) for begin in range(0, length, size)]


def _key(upload_id: str) -> str:
    return f"{FOLDER}{upload_id}"

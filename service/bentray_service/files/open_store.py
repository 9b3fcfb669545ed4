"""Opens the store selected by the settings; a bucket is bound to one database."""

from __future__ import annotations

from pathlib import Path

from bentray_kernels.errors import InvalidInput

from ..errors import StorageUnavailable
from ..rows.database import Database, mark_of
from ..rows.live_ids import LiveIds
from .bucket import Bucket
from .bucket_store import MARK, BucketStore
from .store import Store

FIELD = "BENTRAY_STORAGE_URL"


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

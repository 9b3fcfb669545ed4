"""Which store the settings ask for, opened; a bucket is told which database it belongs to."""

from __future__ import annotations

from pathlib import Path

from bentray_kernels.errors import InvalidInput

from ..refusals import StorageUnavailable
from ..rows.database import Database
from ..rows.database_id import mark_of
from ..rows.live_ids import LiveIds
from .local_store import LocalStore
from .store import Store

FIELD = "BENTRAY_STORAGE_URL"


def open_store(url: str | None, root: Path, database: Database, cache_bytes: int) -> Store:
    """Open the store of a service.

    Args:
        url: ``s3://bucket/prefix``; None for the data folder itself.
        root: the data folder.
        database: whose rows tell what is in the store.
        cache_bytes: as ``BucketStore`` takes it.

    Raises:
        InvalidInput: when the bucket cannot be read and written, is another database's, or what it takes to
            speak with it is not installed.
    """
    if url is None:
        return LocalStore()
    try:
        from .bucket import Bucket
        from .bucket_store import MARK, BucketStore
    except ImportError as error:
        found = f"{url}, without the module {error.name}"
        raise InvalidInput(FIELD, found, "an address once bentray[s3] is installed") from error
    bucket, mark = Bucket(url), mark_of(database)
    try:
        told = bucket.metadata(MARK)
        if told is None and next(bucket.listed(), None) is not None:
            raise InvalidInput(FIELD, f"{url}, where other things lie", "a prefix that nothing else uses")
        if told is not None and told.get("database") != mark:
            found = f"{url}, which belongs to another database than BENTRAY_DATABASE_URL"
            raise InvalidInput(FIELD, found, "a prefix of its own for every database")
        # Also where it is there: that shows that the bucket can be written.
        bucket.put_metadata(MARK, {"database": mark})
    except StorageUnavailable as error:
        found = f"{url} ({error.value})"
        raise InvalidInput(FIELD, found, "a bucket that can be read and written") from error
    return BucketStore(root, bucket, mark, LiveIds(database), cache_bytes)

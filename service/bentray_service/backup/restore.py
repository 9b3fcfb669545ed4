"""Restores a backup into an empty data folder and an empty database, and bucket if there is one.

The database comes last, so that an interrupted restoration is never taken for a service; it can be continued.
"""

import json
import shutil
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

from sqlalchemy import delete, select, update
from sqlalchemy.orm import Session

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.atomic import sync, write_bytes

from ..errors import Damaged
from ..files.bucket_store import open_store
from ..files.data_folder import RESTORING, Files, lock, write_stamp
from ..files.disk import private_files, sha256_of
from ..files.tenant_files import KEPT
from ..rows.database import Database, new_mark, open_database
from ..rows.table_copies import copy_to, has_tables, remove_database, snapshot
from ..rows.tables import (
    VERSION,
    About,
    ExpiredRow,
    JobRow,
    PendingSignInRow,
    SessionRow,
    StorageRow,
    UploadRow,
)
from ..settings import ServiceSettings
from .archive import DATABASE, Description, copy_file, read_description, read_sums

Report = Callable[[int, int], None]


def restore(
    folder: Path, settings: ServiceSettings, report: Report = lambda done, total: None
) -> Description:
    """Restore a backup, or continue a restoration that was interrupted.

    Args:
        folder: of the backup.
        settings: of the new service.
        report: called with the numbers of restored and of all files.

    Raises:
        InvalidInput: when the folder holds no complete backup, or the new places are not empty.
        Damaged: when a file of the backup differs from its checksum; the new service does not start.
        OSError: when a file cannot be written; the same call continues later.
    """
    folder = folder.resolve()
    backup = read_description(folder, VERSION)
    sums = read_sums(folder, backup.sums)
    with private_files():
        root = settings.data_dir.resolve()
        mark = _begin(root, backup, settings)
        files = Files(root)
        files.prepare()
        with closing(lock(root)):
            _check_space(root, backup)
            for number, name in enumerate(sorted(sums)):
                report(number, len(sums))
                target = root / (name if name != DATABASE else RESTORED)
                _copy(folder / name, target, sums[name], always=name == DATABASE)
            report(len(sums), len(sums))
            begun = _restore_database(root, settings, mark)
            write_stamp(root, mark, begun)
            (root / RESTORING).unlink()
            sync(root)
    return backup


# The restored database before it is in its place.
RESTORED = "restored.sqlite"


def _begin(root: Path, backup: Description, settings: ServiceSettings) -> str:
    """Check that the new places are empty, and mark the data folder; returns the id of the new database.

    A restored database has an id of its own: it may be used beside the original, not with the same bucket.
    """
    path = root / RESTORING
    try:
        before: dict[str, Any] = json.loads(path.read_bytes())
    except FileNotFoundError:
        before = {}
    if before and before["backup"] != backup.id:
        found = f"{root}, where the restoration of another backup was interrupted"
        raise InvalidInput("data_dir", found, "the same backup, or a new folder")
    if not before:
        if root.exists() and any(root.iterdir()):
            raise InvalidInput("data_dir", f"{root}, which is not empty", "a new folder, or an empty one")
        before = {"backup": backup.id, "database": new_mark()}
    if settings.database_url is not None and has_tables(settings.database, besides=before["database"]):
        raise InvalidInput("database_url", "a database with tables of a service", "an empty database")
    root.mkdir(mode=0o700, parents=True, exist_ok=True)
    write_bytes(path, json.dumps(before).encode())
    return str(before["database"])


def _copy(source: Path, target: Path, expected: str, *, always: bool) -> None:
    """Copy a file and compare it with its checksum, unless it is there already.

    Raises:
        Damaged: when it differs or is missing.
    """
    if not always and target.is_file() and sha256_of(target) == expected:
        return
    try:
        found = copy_file(source, target)
    except FileNotFoundError:
        raise Damaged(str(source), "missing in the backup") from None
    if found != expected:
        target.unlink()
        raise Damaged(str(source), "different from its checksum in the backup")


def _restore_database(root: Path, settings: ServiceSettings, mark: str) -> int:
    """Put the copied database in its place; returns its number of starts."""
    path = root / RESTORED
    address = f"sqlite:///{path}"
    # A backup of an earlier version is migrated here.
    with closing(open_database(address)) as database:
        with database.write() as session:
            _settle(session, mark)
            begun = session.scalars(select(About.begun)).one()
        _publish(root, settings, database)
    if settings.database_url is None:
        sync(path)
        path.replace(root / "bentray.sqlite")
        return begun
    if not has_tables(settings.database):
        with snapshot(address) as source:
            copy_to(source, settings.database)
    remove_database(path)
    return begun


def _settle(session: Session, mark: str) -> None:
    """Remove what belongs to the old place or is not in the backup.

    These are unfinished uploads, exports, leases, sessions of browsers, and marks of expired items.
    """
    session.execute(update(About).values(database=mark))
    session.execute(delete(UploadRow).where(UploadRow.state.in_(("receiving", "reading"))))
    session.execute(update(JobRow).values(lease_owner=None, lease_until=None))
    session.execute(delete(StorageRow).where(StorageRow.lease_owner.is_not(None)))
    session.execute(delete(StorageRow).where(StorageRow.name.like("%.%")))
    for table in (ExpiredRow, SessionRow, PendingSignInRow):
        session.execute(delete(table))


def _publish(root: Path, settings: ServiceSettings, database: Database) -> None:
    """Store the files in the bucket, if there is one."""
    if settings.storage_url is None:
        return
    store = open_store(settings.storage_url, root, database, settings.cache_bytes)
    for path in sorted(root.glob("tenants/*/*/*")):
        if path.parent.name in KEPT:
            store.publish(path)


def _check_space(root: Path, backup: Description) -> None:
    there = sum(path.stat().st_size for path in root.rglob("*") if path.is_file())
    free = shutil.disk_usage(root).free
    if backup.bytes - there > free:
        found = f"{root}, with {free} bytes free"
        raise InvalidInput("data_dir", found, f"a disk with {backup.bytes - there} bytes free")

"""Writes a backup of a service that may be running: a copy of its database, its files and its audit log.

Stored files never change, so the order makes the backup consistent: first the database at one moment, then
the files that its rows name. If one of them is deleted in between, the database is copied again.
"""

import json
import secrets
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import NamedTuple, get_args

from sqlalchemy import Connection, select

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.atomic import sync, write_bytes

from .. import __version__
from ..errors import DatabaseUnavailable
from ..files.bucket_store import open_store
from ..files.data_folder import Files
from ..files.disk import bytes_in, digest_of, private_files, remove_path, sha256_of
from ..files.store import Store
from ..rows.checksums import Digest
from ..rows.database import Database, open_database
from ..rows.ids import Tenant
from ..rows.table_copies import copy_to_file, snapshot
from ..rows.tables import VERSION, WITH_FILES, ChecksumRow, JobRow, StoredRow
from ..settings import ServiceSettings
from .archive import (
    DATABASE,
    FOLDERS,
    NEWEST,
    SUMS,
    UNFINISHED,
    Description,
    copy_file,
    unfinished_backup,
    write_sums,
)

# Copies of the database until no file that it names is deleted meanwhile.
MOMENTS = 20

Report = Callable[[int, int], None]


class Item(NamedTuple):
    """A stored item of a copied database.

    Attributes:
        tenant, id: owner and id.
        path: in the data folder.
        digest: when it was written; None for one from before version 4.
    """

    tenant: Tenant
    id: str
    path: Path
    digest: Digest | None


def back_up(
    settings: ServiceSettings,
    folder: Path,
    link: Path | None = None,
    report: Report = lambda done, total: None,
) -> Description:
    """Back up a service into a new folder, or continue a backup that was interrupted.

    Args:
        settings: of the service.
        folder: for the backup.
        link: an earlier backup, whose equal files are linked instead of copied.
        report: called with the numbers of copied and of all items.

    Raises:
        InvalidInput: when the folder is not new, or the service has no data or another version.
        OSError: when a file cannot be written; the same call continues later.
    """
    folder, data = folder.resolve(), settings.data_dir.resolve()
    if data == folder or data in folder.parents:
        raise InvalidInput("folder", f"{folder}, inside of the data folder", "a folder outside of it")
    with private_files(), snapshot(settings.database):
        # The service exists, and has this version.
        pass
    with private_files(), unfinished_backup(folder):
        with closing(open_database(settings.database)) as database:
            store = open_store(settings.storage_url, data, database, settings.cache_bytes)
            copier = _Copier(Files(data, store), store, database, folder, link)
            for _ in range(MOMENTS):
                items = copier.copy_database(settings.database)
                if copier.copy_items(items, report):
                    break
            else:
                raise DatabaseUnavailable(f"files deleted during each of {MOMENTS} copies")
        copier.copy_audit()
        copier.remove_others()
        finished = Description(
            bentray=__version__,
            schema=VERSION,
            finished=time.time(),
            id=secrets.token_hex(16),
            items=len(items) - len(copier.missing),
            bytes=sum((folder / name).stat().st_size for name in copier.sums),
            missing=tuple(sorted(copier.missing)),
            sums=write_sums(folder, copier.sums),
        )
        finished.write(folder)
        sync(folder)
    newest = {"finished": finished.finished, "folder": str(folder), "missing": len(finished.missing)}
    write_bytes(data / NEWEST, json.dumps(newest).encode())
    return finished


class _Copier:
    """Copies into the folder of one backup.

    Attributes:
        sums: SHA-256 of each copied file, by its path in the backup.
        missing: items that could not be copied.
    """

    def __init__(
        self, files: Files, store: Store, database: Database, folder: Path, link: Path | None
    ) -> None:
        self._files, self._store, self._database = files, store, database
        self._folder, self._link = folder, link
        self.sums: dict[str, str] = {}
        self.missing: list[str] = []

    def copy_database(self, address: str) -> list[Item]:
        """Copy the database of this moment; returns the items that it names."""
        partial = self._folder / f"{DATABASE}.partial"
        with snapshot(address) as source:
            copy_to_file(source, partial)
            items = list(self._items(source))
        partial.replace(self._folder / DATABASE)
        sync(self._folder / DATABASE)
        self.sums = {DATABASE: sha256_of(self._folder / DATABASE)}
        self.missing = []
        return items

    def _items(self, source: Connection) -> Iterator[Item]:
        """All stored items."""
        digests = {
            (row.tenant, row.id): Digest(row.bytes, row.sha256) for row in source.execute(select(ChecksumRow))
        }
        for table in get_args(StoredRow):
            for row in source.execute(select(table.tenant, table.id)):
                path = self._files.of(row.tenant).stored(row.id)
                yield Item(row.tenant, row.id, path, digests.get((row.tenant, row.id)))
        finished = {"kind": "refraction", "state": "succeeded"}
        turntables = select(JobRow.tenant, JobRow.id, JobRow.settings).filter_by(**finished)
        for tenant, name, settings in source.execute(turntables):
            path = self._files.of(tenant).animation(name, settings["format"])
            yield Item(tenant, name, path, digests.get((tenant, name)))

    def copy_items(self, items: list[Item], report: Report) -> bool:
        """Copy what is not yet in the backup; returns whether every item still exists."""
        self._check_space(items)
        for number, item in enumerate(items):
            report(number, len(items))
            try:
                self._copy(item)
            except FileNotFoundError:
                if not self._exists(item):
                    return False
                self.missing.append(f"{item.tenant}/{item.id}")
        report(len(items), len(items))
        return True

    def copy_audit(self) -> None:
        """Copy the audit log up to its last complete line."""
        for path in sorted(self._files.audit.glob("*.jsonl")):
            whole = path.read_bytes().rfind(b"\n") + 1
            name = f"audit/{path.name}"
            self.sums[name] = copy_file(path, self._folder / name, whole)

    def remove_others(self) -> None:
        """Remove files that an earlier attempt copied and that have been deleted since."""
        known = {self._folder / name for name in self.sums}
        for path in _files_in(self._folder):
            if path not in known and path.name not in (UNFINISHED, SUMS):
                remove_path(path)

    def _copy(self, item: Item) -> None:
        """Copy an item, unless this or the earlier backup has it.

        Raises:
            FileNotFoundError: when it does not exist, or differs from its checksum.
        """
        name = item.path.relative_to(self._files.root)
        target = self._folder / name
        if not self._is_copied(target, item.digest):
            if self._link is not None and self._is_copied(self._link / name, item.digest):
                _link(self._link / name, target)
            else:
                _copy_item(self._store.fetch(item.path), target)
                if item.digest is not None and digest_of(target) != item.digest:
                    raise FileNotFoundError(f"{name} is damaged")
        for path in _files_in(target):
            inside = str(path.relative_to(self._folder))
            whole = item.digest is not None and path == target
            self.sums[inside] = item.digest.sha256 if item.digest and whole else sha256_of(path)

    @staticmethod
    def _is_copied(path: Path, digest: Digest | None) -> bool:
        return digest is not None and path.exists() and digest_of(path) == digest

    def _exists(self, item: Item) -> bool:
        """Whether the service still has the row of an item."""
        with self._database.read() as session:
            return any(
                session.scalar(select(table.id).filter_by(tenant=item.tenant, id=item.id))
                for table in WITH_FILES
            )

    def _check_space(self, items: list[Item]) -> None:
        wanted = sum(item.digest.bytes for item in items if item.digest is not None)
        there = sum(bytes_in(self._folder / name) for name in FOLDERS)
        free = shutil.disk_usage(self._folder).free
        if self._link is None and wanted - there > free:
            accepted = f"a disk with {wanted - there} bytes free; or --link with an earlier backup"
            raise InvalidInput("folder", f"{self._folder}, with {free} bytes free", accepted)


def _files_in(place: Path) -> list[Path]:
    """The files in a folder, or the file itself."""
    return sorted(path for path in place.rglob("*") if path.is_file()) if place.is_dir() else [place]


def _copy_item(source: Path, target: Path) -> None:
    remove_path(target)
    for path in _files_in(source):
        copy_file(path, target / path.relative_to(source))


def _link(source: Path, target: Path) -> None:
    remove_path(target)
    for path in _files_in(source):
        copy = target / path.relative_to(source)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.hardlink_to(path)

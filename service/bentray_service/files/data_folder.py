"""The data folder: folders of tenants, scratch space, audit log and lock; and its database."""

import fcntl
import json
import logging
import re
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import IO, NamedTuple

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.atomic import write_bytes

from ..rows.database import Database, mark_of, open_database
from ..rows.ids import Tenant, checked_tenant
from .disk import close_to_others, remove_path
from .store import Store
from .tenant_files import TenantFiles

log = logging.getLogger("bentray.storage")

# Exists while a backup is restored into a data folder.
RESTORING = "restoring.json"

# The file with the id of the database that used the data folder last, and its number of starts.
STAMP = "database.json"
# Exists in the folder of a service that has required authentication.
GUARDED = "authentication-required"
GUARDED_TEXT = (
    "This service has required authentication. It does not start without keys, OpenID provider and trusted "
    "proxy; delete this file to open it to everyone on this machine.\n"
)


class Files:
    """The data folder of a service.

    ``tenants/`` has a folder for each tenant (see :class:`TenantFiles`), ``scratch/`` temporary files of
    workers, ``audit/`` the audit log.

    Attributes:
        store: keeps the files permanently; default: the data folder itself.
    """

    def __init__(self, data_dir: Path, store: Store | None = None) -> None:
        self.root = data_dir.resolve()
        self.store = store or Store()
        self._tenants = self.root / "tenants"
        self.scratch = self.root / "scratch"
        self.audit = self.root / "audit"

    def prepare(self) -> None:
        """Create the folders, accessible for this user only.

        Raises:
            InvalidInput: when a folder cannot be created or remains accessible for others.
        """
        try:
            self.root.mkdir(mode=0o700, parents=True, exist_ok=True)
            close_to_others(self.root)
            for folder in (self._tenants, self.scratch, self.audit):
                folder.mkdir(mode=0o700, exist_ok=True)
        except OSError as error:
            raise InvalidInput("data_dir", f"{self.root} ({error.strerror})", "a writable folder") from error

    def check_restored(self) -> None:
        """Raises:
        InvalidInput: when the restoration of a backup into this folder was interrupted.
        """
        if (self.root / RESTORING).exists():
            found = f"{self.root}, into which a backup has been restored in part"
            raise InvalidInput("data_dir", found, "a complete folder; the same `bentray restore` continues")

    def of(self, tenant: Tenant) -> TenantFiles:
        """The folders of a tenant; created if needed.

        Raises:
            InvalidInput: for an invalid tenant name.
        """
        files = TenantFiles(self._tenants / checked_tenant(tenant), self.store)
        files.prepare()
        return files

    def used(self) -> bool:
        """Whether the folder has files of tenants, or a record of their requests."""
        paths = (path for pattern in ("tenants/*/*/*", "audit/*") for path in self.root.glob(pattern))
        return next(paths, None) is not None

    def drop_leftovers(self) -> None:
        """Delete incomplete files of a dead process; the folder must be locked."""
        for files in self.all():
            files.drop_leftovers()
        for left in self.scratch.iterdir():
            remove_path(left)

    def all(self) -> Iterator[TenantFiles]:
        """The folders of all tenants."""
        for folder in self._tenants.iterdir():
            yield self.of(Tenant(folder.name))


def lock(root: Path) -> IO[bytes]:
    """Lock the data folder for this process; closing the returned file releases the lock.

    Raises:
        InvalidInput: when another service uses the folder.
    """
    handle = (root / "service.lock").open("a+b")
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        handle.close()
        raise InvalidInput(
            "data_dir", f"{root}, in use by another service", "a separate folder for every service"
        ) from error
    return handle


def installation_of(locked: IO[bytes]) -> str:
    """The id of a locked data folder, 16 hexadecimal digits; written into the lock file at the first start.

    Only one process at a time has it, so whatever an earlier one has left under this id belongs to nobody.
    """
    locked.seek(0)
    text = locked.read(17).decode(errors="replace")
    if re.fullmatch("[0-9a-f]{16}", text):
        return text
    locked.truncate(0)
    locked.write(secrets.token_hex(8).encode())
    locked.flush()
    return installation_of(locked)


class Stamp(NamedTuple):
    """The database that used a data folder last, and its number of starts then."""

    database: str
    begun: int


def open_folder_database(files: Files, address: str) -> Database:
    """Open the database of a service, and record it in a new data folder.

    Args:
        files: the data folder.
        address: of the database.

    Raises:
        InvalidInput: as ``open_database``; when the folder has been used and the database is missing, empty,
            of another program or of another folder: a new one would have no keys, and would be open.
    """
    stamp = read_stamp(files.root)
    used = any((files.root / name).exists() for name in (STAMP, GUARDED)) or files.used()
    way_back = (
        f"the database that {files.root} was used with: put it back, or restore a backup into a new folder "
        "(`bentray restore`); to begin anew, use a new data folder"
    )
    database = open_database(address, way_back if used else None)
    mark = mark_of(database)
    if stamp is not None and stamp.database != mark:
        database.close()
        accepted = f"{way_back}; if the two do belong together, delete {files.root / STAMP}"
        raise InvalidInput("database_url", "the database of another data folder", accepted)
    if not used:
        write_stamp(files.root, mark, 0)
    return database


def read_stamp(root: Path) -> Stamp | None:
    """The record of a data folder about its database; None if it has none or cannot be read."""
    try:
        content = json.loads((root / STAMP).read_bytes())
        return Stamp(str(content["database"]), int(content["begun"]))
    except (OSError, ValueError, KeyError, TypeError):
        return None


def write_stamp(root: Path, mark: str, begun: int) -> None:
    """Record in a data folder the id of its database, and the number of starts."""
    write_bytes(root / STAMP, json.dumps({"database": mark, "begun": begun}).encode())


def remember_authentication(root: Path) -> None:
    """Record in a data folder that its service requires authentication."""
    if not (root / GUARDED).exists():
        write_bytes(root / GUARDED, GUARDED_TEXT.encode())


def check_authentication(root: Path, *, required: bool) -> None:
    """Record that a service requires authentication, or refuse one that did and no longer does.

    Raises:
        InvalidInput: when settings or keys have been lost, and the service would be open.
    """
    if required:
        remember_authentication(root)
    elif (root / GUARDED).exists():
        raise InvalidInput(
            "authentication",
            "no key, OpenID provider or trusted proxy, in a service that has required authentication",
            "BENTRAY_OIDC_ISSUER or BENTRAY_TRUSTED_PROXIES as before, the database with its keys, or a new "
            f"key (`bentray keys create`); to open it to everyone on this machine, delete {root / GUARDED}",
        )

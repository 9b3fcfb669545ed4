"""The data folder: folders of tenants, scratch space, audit log and lock."""

from __future__ import annotations

import fcntl
import logging
import re
import secrets
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import IO

from bentray_kernels.errors import InvalidInput

from ..rows.ids import Tenant, checked_tenant
from .disk import close_to_others, remove_path
from .store import Store
from .tenant_files import TenantFiles

log = logging.getLogger("bentray.storage")

# Exists while a backup is restored into a data folder.
RESTORING = "restoring.json"


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
        for files in self._all():
            files.drop_leftovers()
        for left in self.scratch.iterdir():
            remove_path(left)

    def keep_work(self, job_ids: Collection[str]) -> None:
        """Delete the work folders of all other jobs."""
        for files in self._all():
            files.keep_work(job_ids)

    def sizes(self) -> Iterator[tuple[Tenant, dict[str, int]]]:
        """Sizes of stored items of each tenant in this folder, bytes by id; see ``TenantFiles.sizes``."""
        for files in self._all():
            yield Tenant(files.root.name), files.sizes()

    def _all(self) -> Iterator[TenantFiles]:
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

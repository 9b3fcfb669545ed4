"""The data folder: what belongs to no tenant, the folder of each, and who may use it."""

from __future__ import annotations

import fcntl
import logging
import shutil
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import IO

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.atomic import sync

from ..rows.tenants import LOCAL, Tenant, checked_tenant
from .local_store import LocalStore
from .private import close_to_others
from .store import Store
from .tenant_files import KINDS, TenantFiles

log = logging.getLogger("bentray.storage")


class Files:
    """Folders of one service under ``data_dir``.

    ``tenants/`` holds a folder for each tenant (see :class:`TenantFiles`), ``scratch/`` what workers need
    while they work, ``audit/`` who read and changed what.

    Attributes:
        store: what keeps the files of tenants for good; the data folder itself, if nothing else is given.
    """

    def __init__(self, data_dir: Path, store: Store | None = None) -> None:
        self.root = data_dir.resolve()
        self.store = store or LocalStore()
        self._tenants = self.root / "tenants"
        self.scratch = self.root / "scratch"
        self.audit = self.root / "audit"

    def prepare(self) -> None:
        """Make the folders, and close them to other users of this machine.

        Raises:
            InvalidInput: when the folder cannot be made or written, or others would still reach it.
        """
        try:
            self.root.mkdir(mode=0o700, parents=True, exist_ok=True)
            close_to_others(self.root)
            for folder in (self._tenants, self.scratch, self.audit):
                folder.mkdir(mode=0o700, exist_ok=True)
        except OSError as error:
            raise InvalidInput(
                "data_dir", f"{self.root} ({error.strerror})", "a folder that can be written"
            ) from error

    def of(self, tenant: Tenant) -> TenantFiles:
        """The folders of a tenant, made if needed.

        Raises:
            InvalidInput: for a name that no tenant can have.
        """
        found = TenantFiles(self._tenants / checked_tenant(tenant), self.store)
        found.prepare()
        return found

    def give_to_local(self) -> None:
        """Move what an older version left, before there were tenants; call it once the folder is locked."""
        old = [self.root / name for name in KINDS if (self.root / name).is_dir()]
        if not old:
            return
        log.warning("the data in %s goes to the tenant %s", self.root, LOCAL)
        # An empty folder may be replaced by a full one, and each is by itself: a start that was cut off goes
        # on here.
        local = self.of(LOCAL).root
        for folder in old:
            folder.replace(local / folder.name)
        sync(local)
        sync(self.root)

    def drop_leftovers(self) -> None:
        """Remove what a dead process left half done; call it once the folder is locked."""
        for files in self._all():
            files.drop_leftovers()
        for left in self.scratch.iterdir():
            if left.is_dir():
                shutil.rmtree(left)
            else:
                left.unlink()

    def keep_work(self, job_ids: Collection[str]) -> None:
        """Remove the work folders of all jobs but these."""
        for files in self._all():
            files.keep_work(job_ids)

    def sizes(self) -> Iterator[tuple[Tenant, dict[str, int]]]:
        """Of each tenant what lies here of its stored things, bytes by id; see ``TenantFiles.sizes``."""
        for files in self._all():
            yield Tenant(files.root.name), files.sizes()

    def _all(self) -> Iterator[TenantFiles]:
        for folder in self._tenants.iterdir():
            yield self.of(Tenant(folder.name))


def lock(root: Path) -> IO[bytes]:
    """Take the data folder for this process; closing the returned file, or dying, gives it back.

    Raises:
        InvalidInput: when another service has it. Two would run each other's jobs.
    """
    handle = (root / "service.lock").open("ab")
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        handle.close()
        raise InvalidInput(
            "data_dir", f"{root}, which another service is using", "a folder of its own for every service"
        ) from error
    return handle

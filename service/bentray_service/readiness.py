"""The readiness check, in a thread of its own with a time limit."""

import asyncio
import shutil
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor

from sqlalchemy.exc import SQLAlchemyError

from bentray_kernels.errors import InvalidInput

from .background import BackgroundThread
from .compute import Compute
from .errors import NotReady
from .files.data_folder import Files
from .rows.database import Database

# Time limit of the check, s.
WITHIN_S = 3.0


# (part, found, needed) of a part that does not work.
Fault = tuple[str, str, str]


class Readiness:
    """Checks all parts on request; concurrent requests share one check."""

    def __init__(
        self,
        database: Database,
        files: Files,
        compute: Compute,
        threads: Mapping[str, BackgroundThread],
        min_free_bytes: int,
    ) -> None:
        """Args:
        database, files, compute: to check.
        threads: parts with threads, by name.
        min_free_bytes: minimum free disk space.
        """
        self._database, self._files, self._compute = database, files, compute
        self.threads, self._min_free_bytes = threads, min_free_bytes
        self._pool = ThreadPoolExecutor(1, "readiness")
        self._inspecting: asyncio.Future[tuple[list[Fault], int, int]] | None = None
        # The part that is being checked.
        self._part = "service"

    async def check(self) -> tuple[int, int]:
        """Connected workers and free bytes in the data folder, by the current check or a new one.

        Raises:
            NotReady: naming the parts that do not work, or the one that does not answer in time.
        """
        if self._inspecting is None or self._inspecting.done():
            self._inspecting = asyncio.get_running_loop().run_in_executor(self._pool, self._inspect)
        try:
            async with asyncio.timeout(WITHIN_S):
                faults, workers, free = await asyncio.shield(self._inspecting)
        except TimeoutError:
            raise NotReady(
                [(self._part, f"no answer in {WITHIN_S:g} s", "an answer within this time")]
            ) from None
        if faults:
            raise NotReady(faults)
        return workers, free

    def stop(self) -> None:
        """Start no further checks."""
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _inspect(self) -> tuple[list[Fault], int, int]:
        faults: list[Fault] = []
        self._part = "database"
        try:
            self._database.probe()
        except SQLAlchemyError as error:
            found = error.value if isinstance(error, InvalidInput) else type(error).__name__
            faults.append(("database", found, "a writable database"))
        self._part = "disk"
        free = shutil.disk_usage(self._files.root).free
        if free < self._min_free_bytes:
            needed = f"at least {self._min_free_bytes} bytes (BENTRAY_MIN_FREE_BYTES)"
            faults.append(("disk", f"{free} bytes free", needed))
        self._part = "storage"
        if fault := self._files.store.fault():
            faults.append(("storage", fault, "a readable bucket (BENTRAY_STORAGE_URL)"))
        self._part = "workers"
        workers = self._compute.workers()
        if workers == 0:
            faults.append(("workers", "0 connected", "at least one Dask worker"))
        for part, owner in self.threads.items():
            if not owner.alive():
                faults.append((part, "a thread has ended", "all threads alive; restart the service"))
        return faults, workers, free

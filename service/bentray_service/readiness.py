"""Whether the service can do its work: looked at by a thread of its own, so that nothing else delays it."""

from __future__ import annotations

import asyncio
import shutil
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

from sqlalchemy.exc import SQLAlchemyError

from bentray_kernels.errors import InvalidInput

from .compute import Compute
from .files.data_folder import Files
from .ingest.reader import UploadIngest
from .jobs.runner import Runner
from .refusals import NotReady
from .rows.database import Database

# Who asks is answered within this time, s; a part that takes longer is a fault.
WITHIN_S = 3.0


@dataclass(frozen=True)
class ReadinessReport:
    """What a look gave.

    Attributes:
        faults: (part, found, needed) of each part that does not work.
        workers: connected.
        free_bytes: in the data folder.
    """

    faults: tuple[tuple[str, str, str], ...]
    workers: int
    free_bytes: int


class Readiness:
    """Looks at every part when somebody asks, one look at a time however many ask."""

    def __init__(
        self,
        database: Database,
        files: Files,
        compute: Compute,
        threads: Mapping[str, Runner | UploadIngest],
        min_free_bytes: int,
    ) -> None:
        """Args:
        database, files, compute: that are looked at.
        threads: what has threads that must be alive, by name.
        min_free_bytes: free space below which the disk is a fault.
        """
        self._database, self._files, self._compute = database, files, compute
        self._threads, self._min_free_bytes = threads, min_free_bytes
        self._pool = ThreadPoolExecutor(1, "readiness")
        self._inspecting: asyncio.Future[ReadinessReport] | None = None
        # What the thread looks at now.
        self._part = "service"

    async def report(self) -> ReadinessReport:
        """What a look gives that is under way, or a new one.

        Raises:
            NotReady: naming the part that does not answer in time.
        """
        if self._inspecting is None or self._inspecting.done():
            self._inspecting = asyncio.get_running_loop().run_in_executor(self._pool, self._inspect)
        try:
            async with asyncio.timeout(WITHIN_S):
                return await asyncio.shield(self._inspecting)
        except TimeoutError:
            raise NotReady([(self._part, f"no answer in {WITHIN_S:g} s", "an answer in that time")]) from None

    def stop(self) -> None:
        """Look no more; a look that still waits for a part is left behind."""
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _inspect(self) -> ReadinessReport:
        faults: list[tuple[str, str, str]] = []
        self._part = "database"
        try:
            self._database.probe()
        except SQLAlchemyError as error:
            found = error.value if isinstance(error, InvalidInput) else type(error).__name__
            faults.append(("database", found, "a database that can be written"))
        self._part = "disk"
        free = shutil.disk_usage(self._files.root).free
        if free < self._min_free_bytes:
            needed = f"at least {self._min_free_bytes} bytes (BENTRAY_MIN_FREE_BYTES)"
            faults.append(("disk", f"{free} bytes free", needed))
        self._part = "storage"
        if fault := self._files.store.fault():
            faults.append(("storage", fault, "a bucket that can be read (BENTRAY_STORAGE_URL)"))
        self._part = "workers"
        workers = self._compute.workers()
        if workers == 0:
            faults.append(("workers", "0 connected", "at least one Dask worker"))
        for part, owner in self._threads.items():
            if not owner.alive():
                faults.append((part, "a thread has ended", "every thread alive; start the service anew"))
        return ReadinessReport(tuple(faults), workers, free)

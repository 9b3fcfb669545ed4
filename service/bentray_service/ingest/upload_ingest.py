"""Ingestion of complete resumable uploads in the background; limits of concurrent and of new uploads."""

import contextlib
import logging
import os
import secrets
import signal
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from sqlalchemy.exc import SQLAlchemyError

from bentray_kernels.errors import InvalidInput

from ..access.quota import Quota
from ..access.rate_limits import RateLimits
from ..background import BackgroundThread
from ..errors import Busy, RateLimited, StorageFull, StorageUnavailable, UnknownId
from ..files.data_folder import Files
from ..files.disk import digest_of
from ..rows.accounts import Account, Accounts
from ..rows.database import Database
from ..rows.ids import Tenant
from ..rows.stored_tables import Datasets, Meshes, UploadedTable, UploadedVolumes
from ..rows.tables import UploadRow
from ..rows.uploads import Uploads
from ..settings import ServiceSettings
from ..web.errors import INTERNAL, make_problem, problem_of
from ..web.problem import Problem
from .canonical import IngestLimits, make_canonical
from .fair_queue import FairQueue
from .receive import UploadLocks, discard_unverified, received_bytes

# Each upload has a connection and a reservation; only few are ingested at a time.
MAX_PER_ACCOUNT = 32
MAX_IN_TOTAL = 256
# New resumable uploads of an account per minute.
BEGUN_PER_MINUTE = 120
# Suggested time before the next attempt, s.
AGAIN_S = 10.0

log = logging.getLogger("bentray.ingest")

# Delay after a full disk or an unavailable database or store, s.
PATIENCE_SECONDS = 30.0


class UploadLimits:
    """Counts one-shot uploads in progress and new resumable uploads."""

    def __init__(
        self,
        accounts: Accounts,
        of_account: int = MAX_PER_ACCOUNT,
        in_all: int = MAX_IN_TOTAL,
        begun_per_minute: int = BEGUN_PER_MINUTE,
    ) -> None:
        self._accounts = accounts
        self._of_account = of_account
        self._in_all = in_all
        self._lock = threading.Lock()
        self._there: Counter[Account] = Counter()
        self._begun = RateLimits(begun_per_minute)

    def check_begin(self, tenant: Tenant) -> None:
        """Check the rate limit of new resumable uploads.

        Raises:
            RateLimited: when it is exceeded.
        """
        wait_s = self._begun.take(self._accounts.of(tenant))
        if wait_s > 0.0:
            found = f"more than {self._begun.per_minute} new uploads per minute"
            raise RateLimited("uploads", found, "a lower rate; see Retry-After", wait_s)

    @contextmanager
    def __call__(self, tenant: Tenant) -> Iterator[None]:
        """Count an upload within the block.

        Raises:
            RateLimited: when the tenant has too many uploads in progress.
            Busy: when the service has too many uploads in progress.
        """
        account = self._accounts.of(tenant)
        with self._lock:
            own, all_of_them = self._there[account], self._there.total()
            if own >= self._of_account:
                accepted = f"at most {self._of_account} per tenant at a time; try again later"
                raise RateLimited("uploads", f"{own} in progress", accepted, AGAIN_S)
            if all_of_them >= self._in_all:
                accepted = f"at most {self._in_all} at a time; try again later"
                raise Busy("uploads", f"{all_of_them} in progress", accepted)
            self._there[account] += 1
        try:
            yield
        finally:
            with self._lock:
                self._there[account] -= 1
                if not self._there[account]:
                    del self._there[account]


class UploadIngest(BackgroundThread):
    """Submits complete uploads to the ingest queue, oldest first, with a limit for each account.

    Uploads that a dead service was reading are read again.

    Attributes:
        limits: of an ingest process.
    """

    idle_s, failure = 5.0, "complete uploads could not be queued"

    def __init__(
        self,
        settings: ServiceSettings,
        database: Database,
        files: Files,
        queue: FairQueue,
        accounts: Accounts,
        quota: Quota,
    ) -> None:
        """Args:
        settings: limits of an ingest process, and how long the row of a completed upload is kept.
        database: with the uploads and their results.
        files: the data folder.
        queue: the ingest queue.
        accounts: whose queued uploads are counted.
        quota: of the tenants.
        """
        super().__init__("ingest")
        self.uploads, self.queue = Uploads(database), queue
        self.locks, self.upload_limits = UploadLocks(), UploadLimits(accounts)
        self.limits = IngestLimits(settings.ingest_memory_bytes, settings.ingest_seconds, files.scratch)
        kinds: tuple[type[UploadedTable[Any]], ...] = (Datasets, UploadedVolumes, Meshes)
        self._stores = {kind.what: kind(database) for kind in kinds}
        self._files = files
        self._accounts = accounts
        self._quota = quota
        self._keep_s = settings.upload_keep_s
        self._lock = threading.Lock()
        # Called with each new row.
        self.on_stored: Callable[[Any], None] = lambda row: None
        # Queued uploads, and the process ids of those being read.
        self.queued: dict[str, Account] = {}
        self._children: dict[str, int] = {}
        self._put_off = False

    def start(self) -> None:
        """Continue the uploads of a dead service, then start the thread."""
        for row in self.uploads.in_state("receiving"):
            path = self._files.of(row.tenant).upload(row.id)
            discard_unverified(path)
            # The service died before it marked the upload as complete.
            if received_bytes(path) == row.length:
                self.uploads.change(row.id, state="reading")
        super().start()

    def stop(self) -> None:
        """End the thread and the ingest processes; their uploads are read again at the next start."""
        self._leaving.set()
        with self._lock:
            children = list(self._children.values())
        for child in children:
            _end(child)
        super().stop()

    def _step(self) -> bool:
        try:
            self._submit()
        except SQLAlchemyError as error:
            self._wait(error)
        if not self._put_off:
            return False
        self._put_off = False
        self._leaving.wait(PATIENCE_SECONDS)
        return True

    def _submit(self) -> None:
        """Queue complete uploads, at most ``FairQueue.share`` of each account."""
        with self._lock:
            queued = set(self.queued)
            room = Counter({account: -count for account, count in Counter(self.queued.values()).items()})
        for row in self.uploads.in_state("reading"):
            account = self._accounts.of(row.tenant)
            if row.id in queued or room[account] + self.queue.share <= 0 or not self._is_local(row):
                continue
            room[account] -= 1
            with self._lock:
                self.queued[row.id] = account
            future = self.queue.submit(row.tenant, partial(self._read, row))
            future.add_done_callback(partial(self._ended, row.id))

    def _ended(self, upload_id: str, future: Future[None]) -> None:
        with self._lock:
            del self.queued[upload_id]
        error = None if future.cancelled() else future.exception()
        if error is not None:
            self._wait(error)
        self._wake.set()

    def _wait(self, error: BaseException) -> None:
        """Log an error and pause."""
        log.warning("ingestion of uploads pauses: %s", error)
        self._put_off = True

    def _is_local(self, row: UploadRow) -> bool:
        """Whether the data is in this data folder, not in that of another service."""
        tenant = row.tenant
        path = self._files.of(tenant).upload(row.id)
        return path.exists() or self._known(self._stores[row.what], tenant, row.result_id)

    def _read(self, row: UploadRow) -> None:
        if self._leaving.is_set():
            return
        tenant, store = row.tenant, self._stores[row.what]
        path = self._files.of(tenant).upload(row.id)
        if not self._known(store, tenant, row.result_id):
            problem = self._refusal(row, tenant, store, path)
            if problem is not None:
                if not self._leaving.is_set():
                    self._drop(row)
                    said = problem.model_dump(exclude_none=True)
                    self.uploads.keep(row.id, self._keep_s, state="refused", problem=said)
                    path.unlink(missing_ok=True)
                return
        self._drop(row)
        self.uploads.keep(row.id, self._keep_s, state="done")
        path.unlink(missing_ok=True)

    def _drop(self, row: UploadRow) -> None:
        """Delete what is in the bucket, before the row says so; the file here is still complete."""
        direct = self._files.store.direct_uploads
        if row.multipart_id is not None and direct is not None:
            direct.drop_later(row)

    def _fetch(self, row: UploadRow, path: Path) -> None:
        """Get the data of a direct upload from the bucket, unless that was done before."""
        if row.multipart_id is None or path.stat().st_size == row.length:
            return
        direct = self._files.store.direct_uploads
        if direct is None:
            raise StorageUnavailable("no bucket; BENTRAY_STORAGE_URL named one before")
        try:
            direct.fetch(row, path)
        except FileNotFoundError:
            raise InvalidInput("upload", "no data in the bucket", "a new upload") from None

    def _refusal(
        self, row: UploadRow, tenant: Tenant, store: UploadedTable[Any], path: Path
    ) -> Problem | None:
        """Ingest an upload; returns the problem of a refused one, else None."""
        instance, files = f"/v1/uploads/{row.id}", self._files.of(tenant)
        try:
            self._fetch(row, path)
            summary = make_canonical(
                row.what,
                path,
                row.result_id,
                files,
                self.limits,
                row.given,
                partial(self._quota.resize, tenant, row.result_id),
                partial(self._started, row.id),
            )
            digest = digest_of(path).sha256
            stored = store.add(tenant, row.result_id, size=row.length, sha256=digest, summary=summary)
            self.on_stored(stored)
        except (StorageUnavailable, StorageFull, SQLAlchemyError):
            raise
        except InvalidInput as error:
            return problem_of(error, instance)
        except Exception:
            # An unexpected error must not stop the thread.
            number = secrets.token_hex(8)
            log.exception("%s could not be ingested [%s]", row.id, number)
            words = f"internal error of the service; see the log entry {number}"
            return make_problem(INTERNAL, words, instance=instance, correlation_id=number)
        finally:
            with self._lock:
                self._children.pop(row.id, None)
        return None

    def _known(self, store: UploadedTable[Any], tenant: Tenant, name: str) -> bool:
        """Whether the result exists already, from a service that died."""
        try:
            store.get(tenant, name)
        except UnknownId:
            return False
        return True

    def _started(self, upload_id: str, process_id: int) -> None:
        with self._lock:
            self._children[upload_id] = process_id
        if self._leaving.is_set():
            _end(process_id)


def _end(process_id: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process_id, signal.SIGKILL)

"""The thread that reads uploads which came in pieces, once they are whole."""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import secrets
import signal
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

from sqlalchemy.exc import SQLAlchemyError

from bentray_kernels.errors import InvalidInput

from ..errors import INTERNAL, Problem, from_exception, make
from ..refusals import StorageAway, StorageFull, UnknownId
from ..storage.files import Files
from ..storage.tenants import Tenant
from ..storage.uploads import Uploads
from .append import size_of
from .canonical import Limits, make_canonical
from .receive import BATCH_BYTES

log = logging.getLogger("bentray.ingest")

Row = dict[str, Any]

# How long it waits before it looks by itself, s; a whole upload wakes it at once.
IDLE_SECONDS = 5.0
# How long it waits when the disk is full or the database or the storage away, s.
PATIENCE_SECONDS = 30.0
STOP_SECONDS = 30.0


class Store(Protocol):
    """The rows of what an upload becomes."""

    def add(self, tenant: Tenant, name: str, /, *, size: int, sha256: str, summary: Row) -> Row: ...

    def get(self, tenant: Tenant, name: str, /) -> Row: ...


class UploadReader:
    """Reads one upload after another, the oldest first, each by a process of its own.

    What a service that died was reading is read again.
    """

    def __init__(
        self, uploads: Uploads, files: Files, stores: Mapping[str, Store], limits: Limits, keep_s: float
    ) -> None:
        """Args:
        uploads: their rows.
        files: where they lie.
        stores: the rows of what they become, by the word for it.
        limits: of a process.
        keep_s: how long the row of a read upload is kept, s.
        """
        self._uploads = uploads
        self._files = files
        self._stores = stores
        self._limits = limits
        self._keep_s = keep_s
        self._wake = threading.Event()
        self._leaving = threading.Event()
        self._child_id: int | None = None
        self._thread = threading.Thread(target=self._loop, name="uploads", daemon=True)

    def start(self) -> None:
        """Take up what a dead process left, then begin."""
        for row in self._uploads.receiving():
            # It died between the last byte and saying so.
            if size_of(self._files.of(Tenant(row["tenant"])).upload(row["id"])) == row["length"]:
                self._uploads.arrived(row["id"])
        self._thread.start()

    def notify(self) -> None:
        """Say that an upload is whole."""
        self._wake.set()

    def alive(self) -> bool:
        """Whether the thread is there."""
        return self._thread.is_alive()

    def stop(self) -> None:
        """End the thread, and the process whose work it waits for; that upload is read at the next start."""
        self._leaving.set()
        self._wake.set()
        self._end_child()
        self._thread.join(STOP_SECONDS)

    def _loop(self) -> None:
        while not self._leaving.is_set():
            self._wake.clear()
            pause = IDLE_SECONDS
            try:
                for row in self._uploads.unread():
                    if self._leaving.is_set():
                        return
                    self._read(row)
            except (SQLAlchemyError, StorageAway, StorageFull) as error:
                log.warning("uploads wait: %s", error)
                pause = PATIENCE_SECONDS
            self._wake.wait(pause) if pause == IDLE_SECONDS else self._leaving.wait(pause)

    def _read(self, row: Row) -> None:
        tenant, store = Tenant(row["tenant"]), self._stores[row["what"]]
        path = self._files.of(tenant).upload(row["id"])
        if not self._known(store, tenant, row["result_id"]):
            if not path.exists():
                # It lies with another service that uses this database.
                return
            problem = self._refusal(row, tenant, store, path)
            if problem is not None:
                if not self._leaving.is_set():
                    self._uploads.refuse(row["id"], problem.model_dump(exclude_none=True), self._keep_s)
                    path.unlink(missing_ok=True)
                return
        self._uploads.done(row["id"], self._keep_s)
        path.unlink(missing_ok=True)

    def _refusal(self, row: Row, tenant: Tenant, store: Store, path: Path) -> Problem | None:
        """Read and store an upload; why it cannot be, or None."""
        instance, files = f"/v1/uploads/{row['id']}", self._files.of(tenant)
        try:
            summary = make_canonical(
                row["what"], path, row["result_id"], files, self._limits, row["given"], self._started
            )
            store.add(tenant, row["result_id"], size=row["length"], sha256=digest_of(path), summary=summary)
        except (StorageAway, StorageFull, SQLAlchemyError):
            raise
        except InvalidInput as error:
            return from_exception(error, instance)
        except Exception:
            # The thread must outlive what nobody foresaw, and the next upload may be a better one.
            number = secrets.token_hex(8)
            log.exception("%s could not be read [%s]", row["id"], number)
            words = f"an error of the service, not of the file; it is in the log under {number}"
            return make(INTERNAL, words, instance=instance, correlation_id=number)
        finally:
            self._child_id = None
        return None

    def _known(self, store: Store, tenant: Tenant, name: str) -> bool:
        """Whether a service died after it had stored the result."""
        try:
            store.get(tenant, name)
        except UnknownId:
            return False
        return True

    def _started(self, process_id: int) -> None:
        self._child_id = process_id
        if self._leaving.is_set():
            self._end_child()

    def _end_child(self) -> None:
        child = self._child_id
        if child is not None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child, signal.SIGKILL)


def digest_of(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while piece := file.read(BATCH_BYTES):
            digest.update(piece)
    return digest.hexdigest()

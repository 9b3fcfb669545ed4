"""Storage quotas: space is reserved before work begins."""

import logging
import os
import secrets
import socket
import threading
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

from sqlalchemy.exc import SQLAlchemyError
from starlette.concurrency import run_in_threadpool

from ..files.data_folder import Files
from ..rows import usage
from ..rows.database import Database
from ..rows.ids import Tenant
from ..rows.usage import Lease, Usage

log = logging.getLogger("bentray.access")

# Time after which a process that does not renew its reservations is considered dead, s.
LEASE_S = 900.0


class Quota:
    """Reserves storage for tenants in the database, shared by all services."""

    def __init__(self, database: Database, most_bytes: int, clock: Callable[[], float] = time.time) -> None:
        """Args:
        database: stores the reservations.
        most_bytes: quota of each tenant.
        clock: seconds since 1970.
        """
        self.most_bytes = most_bytes
        self._database = database
        self._clock = clock
        self._lock = threading.Lock()
        # Reservations to release.
        self._ended: set[tuple[Tenant, str]] = set()
        self._owner = f"{socket.gethostname()[:40]}-{os.getpid()}-{secrets.token_hex(4)}"

    def of(self, tenant: Tenant) -> Usage:
        """Usage of a tenant."""
        with self._database.read() as connection:
            return usage.usage_of(connection, tenant)

    @asynccontextmanager
    async def reserved(self, tenant: Tenant, name: str, size: int) -> AsyncIterator[None]:
        """Reserve storage within the block; stored items are kept at its end, the rest is released.

        Args:
            tenant: owner.
            name: id of the item.
            size: its maximum size, bytes; ``resize`` changes it.

        Raises:
            QuotaExceeded: when less is available.
        """
        await run_in_threadpool(self.resize, tenant, name, size)
        try:
            yield
        finally:
            await run_in_threadpool(self.release, tenant, name)

    def resize(self, tenant: Tenant, name: str, size: int) -> None:
        """Change or create a reservation of this process.

        Raises:
            QuotaExceeded: when less is available; the reservation is unchanged.
        """
        with self._database.write() as connection:
            usage.reserve(connection, tenant, name, size, self.most_bytes, self._lease())

    def stored(self, tenant: Tenant, name: str, size: int) -> None:
        """Record the size of a stored item without a row."""
        with self._database.write() as connection:
            usage.store(connection, tenant, name, size)

    def gone(self, tenant: Tenant, name: str) -> None:
        """Record the deletion of an item without a row."""
        with self._database.write() as connection:
            usage.forget(connection, tenant, [name])

    def release(self, tenant: Tenant, name: str) -> None:
        """Release a reservation; repeated later if the database is unavailable."""
        with self._lock:
            self._ended.add((tenant, name))
        try:
            self._release_ended()
        except SQLAlchemyError as error:
            log.warning("the reservation of %s will be released later: %s", name, error)

    def begin(self, files: Files, *, alone: bool) -> None:
        """Drop reservations of dead processes, and correct the sizes of stored items.

        Args:
            files: the data folder.
            alone: whether no other service uses the database; then all reservations are dropped.
        """
        with self._database.write() as connection:
            usage.drop_leased(connection) if alone else usage.drop_expired(connection)
        for folder in files.all():
            with self._database.write() as connection:
                usage.correct(connection, Tenant(folder.root.name), folder.sizes())

    def renew(self) -> None:
        """Renew the reservations of this process, and drop those of dead processes."""
        self._release_ended()
        with self._database.write() as connection:
            usage.renew(connection, self._lease())
            usage.drop_expired(connection)

    def _release_ended(self) -> None:
        with self._lock:
            ended = list(self._ended)
        with self._database.write() as connection:
            for tenant, name in ended:
                usage.release(connection, tenant, name)
        with self._lock:
            self._ended.difference_update(ended)

    def _lease(self) -> Lease:
        return Lease(self._owner, self._clock() + LEASE_S)

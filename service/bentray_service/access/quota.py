"""How much a tenant may store: reserved before the work begins, so that nothing comes together beyond it."""

from __future__ import annotations

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
from ..rows.tenants import Tenant
from ..rows.usage import Lease, Usage

log = logging.getLogger("bentray.access")

# How long a process that says nothing is believed to be at work on what it has reserved room for, s.
LEASE_S = 900.0


class Quota:
    """Reserves room for what tenants are about to store, in the database: services that share it agree."""

    def __init__(self, database: Database, most_bytes: int, clock: Callable[[], float] = time.time) -> None:
        """Args:
        database: which holds the rows.
        most_bytes: that a tenant may store.
        clock: seconds since 1970.
        """
        self.most_bytes = most_bytes
        self._database = database
        self._clock = clock
        self._lock = threading.Lock()
        # What is to be released.
        self._ended: set[tuple[Tenant, str]] = set()
        self._owner = f"{socket.gethostname()[:40]}-{os.getpid()}-{secrets.token_hex(4)}"

    def of(self, tenant: Tenant) -> Usage:
        """What a tenant stores and has reserved."""
        with self._database.read() as connection:
            return usage.usage_of(connection, tenant)

    @asynccontextmanager
    async def reserved(self, tenant: Tenant, name: str, size: int) -> AsyncIterator[None]:
        """Reserve room while the block runs; what has been stored by its end stays, without anything else.

        Args:
            tenant: whose it is.
            name: of the thing that is to come.
            size: bytes that it will have at most; ``resize`` changes it.

        Raises:
            QuotaUsedUp: when there is less room.
        """
        await run_in_threadpool(self.resize, tenant, name, size)
        try:
            yield
        finally:
            await run_in_threadpool(self.release, tenant, name)

    def resize(self, tenant: Tenant, name: str, size: int) -> None:
        """Change how much is reserved for a thing; it is reserved for this process if nothing was.

        Raises:
            QuotaUsedUp: when there is less room; what was reserved stays so.
        """
        with self._database.write() as connection:
            usage.reserve(connection, tenant, name, size, self.most_bytes, self._lease())

    def stored(self, tenant: Tenant, name: str, size: int) -> None:
        """Say that a thing without a row of its own is stored now, and how large it is."""
        with self._database.write() as connection:
            usage.store(connection, tenant, name, size)

    def gone(self, tenant: Tenant, name: str) -> None:
        """Say that a thing without a row of its own is stored no more."""
        with self._database.write() as connection:
            usage.forget(connection, tenant, [name])

    def release(self, tenant: Tenant, name: str) -> None:
        """Give up a reservation, later if the database is away now; what is stored by then stays."""
        with self._lock:
            self._ended.add((tenant, name))
        try:
            self._release_ended()
        except SQLAlchemyError:
            log.warning("the reservation of %s is given up later", name, exc_info=True)

    def begin(self, files: Files, *, alone: bool) -> None:
        """Drop what processes that died had reserved, and take the sizes of the files that lie here.

        Args:
            files: the data folder.
            alone: no other service uses the database, so that none of the reservations is of a living one.
        """
        with self._database.write() as connection:
            usage.drop_leased(connection) if alone else usage.drop_expired(connection)
        for tenant, sizes in files.sizes():
            with self._database.write() as connection:
                usage.correct(connection, tenant, sizes)

    def renew(self) -> None:
        """Say that this process is still at work, and drop what those that died had reserved."""
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

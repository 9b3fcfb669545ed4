"""Idempotency keys: a repeated request makes nothing a second time."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass

from sqlalchemy import Connection, Table, func, select

from ..errors import KeyReused
from .tenants import Tenant
from .typed_rows import Plain


@dataclass(frozen=True)
class RequestKey:
    """The idempotency key of a request, and what it was used for.

    Attributes:
        key: of the client; None: the request has none, and is never taken for a repeated one.
        digest: SHA-256 of the request.
    """

    key: str | None
    digest: str

    @classmethod
    def from_header(cls, key: str | None, request: object) -> RequestKey:
        """The key of a request, given as what JSON can hold."""
        return cls(key, hashlib.sha256(json.dumps(request, sort_keys=True).encode()).hexdigest())

    def columns(self) -> Plain:
        """The values of a row that the request inserts."""
        return {"idempotency_key": self.key, "request_sha256": self.digest}

    def earlier(self, connection: Connection, table: Table, tenant: Tenant) -> Plain | None:
        """The row that an earlier request with this key inserted; concurrent requests with it wait.

        Args:
            connection: in a write transaction.
            table: with the columns of ``columns``.
            tenant: owner.

        Raises:
            KeyReused: when it was another request.
        """
        if self.key is None:
            return None
        if connection.dialect.name != "sqlite":
            # Write transactions of SQLite are serialised; this lock serialises those of PostgreSQL.
            words = f"{tenant}/{self.key}".encode()
            lock = int.from_bytes(hashlib.sha256(words).digest()[:8], signed=True)
            connection.execute(select(func.pg_advisory_xact_lock(lock)))
        mine = select(table).where(table.c.tenant == tenant, table.c.idempotency_key == self.key)
        row = connection.execute(mine).mappings().one_or_none()
        if row is not None and row["request_sha256"] != self.digest:
            accepted = "a unique key for every request; this key was used with another request"
            raise KeyReused("Idempotency-Key", repr(self.key), accepted)
        return None if row is None else dict(row)

"""Idempotency keys: a repeated request makes nothing a second time."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from typing import TypeVar

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from ..errors import KeyReused
from .tables import BatchRow, DatasetRow, JobRow, Plain
from .tenants import Tenant

# The tables of what a request with a key makes.
Row = TypeVar("Row", DatasetRow, JobRow, BatchRow)


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

    def earlier(self, session: Session, table: type[Row], tenant: Tenant) -> Row | None:
        """The row that an earlier request with this key inserted; concurrent requests with it wait.

        Args:
            session: in a write transaction.
            table: with the columns of ``columns``.
            tenant: owner.

        Raises:
            KeyReused: when it was another request.
        """
        if self.key is None:
            return None
        if session.get_bind().dialect.name != "sqlite":
            # Write transactions of SQLite are serialised; this lock serialises those of PostgreSQL.
            words = f"{tenant}/{self.key}".encode()
            lock = int.from_bytes(hashlib.sha256(words).digest()[:8], signed=True)
            session.execute(select(func.pg_advisory_xact_lock(lock)))
        mine = select(table).filter_by(tenant=tenant, idempotency_key=self.key)
        row = session.scalars(mine).one_or_none()
        if row is not None and row.request_sha256 != self.digest:
            accepted = "a unique key for every request; this key was used with another request"
            raise KeyReused("Idempotency-Key", repr(self.key), accepted)
        return row

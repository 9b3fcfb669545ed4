"""The tables of sessions in browsers, and of sign-ins under way."""

from __future__ import annotations

import hashlib
import hmac
import secrets
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

from sqlalchemy import delete, func, insert, select

from .database import Database
from .schema import pending_sign_ins, sessions
from .tenants import Tenant
from .typed_rows import PendingSignInRow, Plain, SessionRow

# Time for the user to sign in at the provider, s.
PENDING_S = 600.0
# Pending sign-ins that are kept; anyone may begin one, and beyond this number the oldest are dropped.
MAX_PENDING = 10_000

ID_PREFIX = "session-"


@dataclass(frozen=True, repr=False)
class PendingSignIn:
    """The secrets of a sign-in under way; only digests of the first two are stored.

    Attributes:
        state: goes to the provider and comes back with the browser.
        browser: cookie of the browser that began, so that no other can end it.
        nonce: is repeated in the ID token.
        verifier: of PKCE (RFC 7636).
    """

    state: str
    browser: str
    nonce: str
    verifier: str

    @classmethod
    def new(cls) -> PendingSignIn:
        """New random secrets."""
        return cls(*(secrets.token_urlsafe(32) for _ in range(4)))


class Sessions:
    """Sessions of all tenants. The secret of a session is in a cookie; its digest is stored."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def begin(self, pending: PendingSignIn, address: str) -> None:
        """Store a sign-in under way.

        Args:
            pending: its secrets.
            address: part of the page to return to.
        """
        now = time.time()
        row = {"state_sha256": digest(pending.state), "browser_sha256": digest(pending.browser)}
        row |= {"nonce": pending.nonce, "verifier": pending.verifier, "address": address}
        table = pending_sign_ins.c
        with self._database.write() as connection:
            connection.execute(delete(pending_sign_ins).where(table.expires <= now))
            connection.execute(insert(pending_sign_ins).values(**row, expires=now + PENDING_S))
            newest = connection.execute(select(func.max(table.number))).scalar_one()
            connection.execute(delete(pending_sign_ins).where(table.number <= newest - MAX_PENDING))

    def take(self, state: str, browser: str) -> PendingSignInRow | None:
        """Remove and return a sign-in; None if it is unknown, used, expired or of another browser."""
        mine = pending_sign_ins.c.state_sha256 == digest(state)
        with self._database.write() as connection:
            row = connection.execute(select(pending_sign_ins).where(mine)).mappings().one_or_none()
            # Of two requests at the same time, one deletes the row.
            taken = connection.execute(delete(pending_sign_ins).where(mine)).rowcount
        if row is None or not taken or row["expires"] <= time.time():
            return None
        if not hmac.compare_digest(row["browser_sha256"], digest(browser)):
            return None
        return cast(PendingSignInRow, dict(row))

    def start(
        self, tenant: Tenant, who: str, scopes: Sequence[str], seconds: float
    ) -> tuple[str, SessionRow]:
        """Start a session of a user; returns its secret and its row."""
        secret, now = secrets.token_urlsafe(32), time.time()
        row: Plain = {"id": f"{ID_PREFIX}{secrets.token_hex(10)}", "tenant": tenant, "who": who[:200]}
        row |= {"sha256": digest(secret), "scopes": list(scopes)}
        with self._database.write() as connection:
            connection.execute(delete(sessions).where(sessions.c.expires <= now))
            connection.execute(insert(sessions).values(**row, created=now, expires=now + seconds))
        found = self.owner(secret)
        assert found is not None
        return secret, found

    def owner(self, secret: str) -> SessionRow | None:
        """The row of a valid session; None if it is unknown, ended or expired."""
        query = select(sessions).where(sessions.c.sha256 == digest(secret), sessions.c.expires > time.time())
        rows = self._database.rows(query)
        return cast(SessionRow, rows[0]) if rows else None

    def end(self, secret: str) -> None:
        """End a session."""
        with self._database.write() as connection:
            connection.execute(delete(sessions).where(sessions.c.sha256 == digest(secret)))

    def ended(self, ids: Sequence[str]) -> list[str]:
        """The sessions among ``ids`` that have ended or expired."""
        valid = select(sessions.c.id).where(sessions.c.id.in_(ids), sessions.c.expires > time.time())
        with self._database.read() as connection:
            left = set(connection.execute(valid).scalars())
        return [one for one in ids if one.startswith(ID_PREFIX) and one not in left]


def digest(secret: str) -> str:
    """Digest to store, hexadecimal; one round is sufficient for 256 random bits."""
    return hashlib.sha256(secret.encode()).hexdigest()

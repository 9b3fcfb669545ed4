"""The tables of sessions in browsers, and of sign-ins under way."""

from __future__ import annotations

import hashlib
import hmac
import secrets
import time
from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import delete, select

from .database import Repository, rows_changed
from .ids import Tenant
from .tables import PendingSignInRow, SessionRow

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


class Sessions(Repository):
    """Sessions of all tenants. The secret of a session is in a cookie; its digest is stored."""

    def begin(self, pending: PendingSignIn, address: str) -> None:
        """Store a sign-in under way.

        Args:
            pending: its secrets.
            address: part of the page to return to.
        """
        now = time.time()
        row = PendingSignInRow(state_sha256=digest(pending.state), browser_sha256=digest(pending.browser))
        row.nonce, row.verifier, row.address = pending.nonce, pending.verifier, address
        row.expires = now + PENDING_S
        with self._database.write() as session:
            session.execute(delete(PendingSignInRow).where(PendingSignInRow.expires <= now))
            session.add(row)
            session.flush()
            dropped = PendingSignInRow.number <= row.number - MAX_PENDING
            session.execute(delete(PendingSignInRow).where(dropped))

    def take(self, state: str, browser: str) -> PendingSignInRow | None:
        """Remove and return a sign-in; None if it is unknown, used, expired or of another browser."""
        mine = PendingSignInRow.state_sha256 == digest(state)
        with self._database.write() as session:
            row = session.scalar(select(PendingSignInRow).where(mine))
            # Of two requests at the same time, one deletes the row.
            taken = rows_changed(session, delete(PendingSignInRow).where(mine))
        if row is None or not taken or row.expires <= time.time():
            return None
        if not hmac.compare_digest(row.browser_sha256, digest(browser)):
            return None
        return row

    def start(
        self, tenant: Tenant, who: str, scopes: Sequence[str], seconds: float
    ) -> tuple[str, SessionRow]:
        """Start a session of a user; returns its secret and its row."""
        secret, now = secrets.token_urlsafe(32), time.time()
        row = SessionRow(id=f"{ID_PREFIX}{secrets.token_hex(10)}", tenant=tenant, who=who[:200])
        row.sha256, row.scopes, row.created, row.expires = digest(secret), list(scopes), now, now + seconds
        with self._database.write() as session:
            session.execute(delete(SessionRow).where(SessionRow.expires <= now))
            session.add(row)
        return secret, row

    def owner(self, secret: str) -> SessionRow | None:
        """The row of a valid session; None if it is unknown, ended or expired."""
        valid = SessionRow.sha256 == digest(secret), SessionRow.expires > time.time()
        return self._database.row(select(SessionRow).where(*valid))

    def end(self, secret: str) -> None:
        """End a session."""
        self._database.change(delete(SessionRow).where(SessionRow.sha256 == digest(secret)))

    def ended(self, ids: Sequence[str]) -> list[str]:
        """The sessions among ``ids`` that have ended or expired."""
        valid = select(SessionRow.id).where(SessionRow.id.in_(ids), SessionRow.expires > time.time())
        left = set(self._database.rows(valid))
        return [one for one in ids if one.startswith(ID_PREFIX) and one not in left]


def digest(secret: str) -> str:
    """Digest to store, hexadecimal; one round is sufficient for 256 random bits."""
    return hashlib.sha256(secret.encode()).hexdigest()

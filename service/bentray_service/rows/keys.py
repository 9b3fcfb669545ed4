"""Who may come in: API keys, claimed names and sessions of browsers; secrets are never stored."""

from __future__ import annotations

import hashlib
import hmac
import json
import logging
import re
import secrets
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from sqlalchemy import Delete, delete, func, or_, select, update
from sqlalchemy.exc import IntegrityError, SQLAlchemyError
from sqlalchemy.orm import Session

from bentray_kernels.errors import InvalidInput

from .database import Database, Repository, rows_changed
from .ids import GIVEN, LOCAL, TENANT_PATTERN, Tenant
from .tables import ClaimedTenantRow, KeyRow, PendingSignInRow, SessionRow

log = logging.getLogger("bentray.access")

PREFIX = "bentray_"
ACCEPTED = "bentray_, 12 hexadecimal digits, _ and 40 more"
# Also used to remove keys from logs.
PATTERN = re.compile(r"bentray_([0-9a-f]{12})_([0-9a-f]{40})")
# Resolution of the stored time of last use, s; it avoids one write per request.
USED_S = 60.0
# Time for the user to sign in at the provider, s.
PENDING_S = 600.0
# Pending sign-ins that are kept; anyone may begin one, and beyond this number the oldest are dropped.
MAX_PENDING = 10_000
ID_PREFIX = "session-"


def former_tenant(user: str) -> Tenant:
    """The tenant of a user before version 13 of the database: the name itself, or its digest if not valid."""
    if TENANT_PATTERN.fullmatch(user) and user != LOCAL and not GIVEN.fullmatch(user):
        return Tenant(user)
    return Tenant(f"user-{hashlib.sha256(user.encode()).hexdigest()[:40]}")


class ClaimedTenants(Repository):
    """Gives each name of a user or group that a provider or a proxy reports a tenant of its own.

    No key and no other name has it, and the name has the same one at all times.
    """

    def __init__(self, database: Database) -> None:
        super().__init__(database)
        self._known: dict[tuple[str, str, str], Tenant] = {}

    def tenant(self, issuer: str, claim: str, value: str, before: str) -> Tenant:
        """The tenant of a name; stored at its first use.

        Args:
            issuer: who says it: of the provider, or ``proxy``.
            claim: its claim or header.
            value: the name.
            before: from which versions before 13 of the database made the name of the tenant.
        """
        name = (issuer, claim, value)
        if name not in self._known:
            try:
                self._known[name] = self._find(name) or self._add(name, former_tenant(before))
            except IntegrityError:
                # Another service on this database was first.
                self._known[name] = Tenant(self._find(name) or "")
        return self._known[name]

    def keep_from_claims(self, tenants: Collection[Tenant]) -> None:
        """Tenants that the operator has named are never given to a claimed name of before."""
        self._database.change(unclaiming(tenants))

    def _find(self, name: tuple[str, str, str]) -> Tenant | None:
        named = {"issuer": name[0], "claim": name[1], "value": name[2]}
        return self._database.row(select(ClaimedTenantRow.tenant).filter_by(**named))

    def _add(self, name: tuple[str, str, str], former: Tenant) -> Tenant:
        row = dict(zip(("issuer", "claim", "value"), name, strict=True))
        unclaimed = update(ClaimedTenantRow).filter_by(issuer="", tenant=former)
        tenant = Tenant(f"user-{hashlib.sha256(json.dumps(name).encode()).hexdigest()[:40]}")
        with self._database.write() as session:
            if rows_changed(session, unclaimed.values(**row)):
                log.warning("%s of %s keeps the tenant %s, which an earlier version gave", *name[1:], former)
                return former
            session.add(ClaimedTenantRow(tenant=tenant, **row))
        return tenant


def is_claimed(session: Session, tenant: Tenant) -> bool:
    """Whether a claimed name has this tenant."""
    claimed = ClaimedTenantRow.tenant == tenant, ClaimedTenantRow.issuer != ""
    return session.scalar(select(ClaimedTenantRow.number).where(*claimed)) is not None


def unclaiming(tenants: Collection[Tenant]) -> Delete:
    """The statement of ``ClaimedTenants.keep_from_claims``."""
    return delete(ClaimedTenantRow).where(ClaimedTenantRow.issuer == "", ClaimedTenantRow.tenant.in_(tenants))


@dataclass(frozen=True, repr=False)
class ApiKey:
    """An API key with its secret; ``repr`` does not show the secret.

    Attributes:
        id: public identifier of the key.
    """

    id: str
    _secret: str

    @classmethod
    def new(cls) -> ApiKey:
        """A new random key."""
        return cls(secrets.token_hex(6), secrets.token_hex(20))

    @classmethod
    def from_text(cls, text: str) -> ApiKey | None:
        """Parse ``text``; None if it does not have the format of a key."""
        match = PATTERN.fullmatch(text)
        return None if match is None else cls(match[1], match[2])

    @classmethod
    def given(cls, field: str, text: str) -> ApiKey:
        """Parse ``text``.

        Raises:
            InvalidInput: naming ``field``; the text itself is not shown, since it may contain a secret.
        """
        key = cls.from_text(text)
        if key is None:
            raise InvalidInput(field, f"{len(text)} characters that are not a key", ACCEPTED)
        return key

    def digest(self) -> str:
        """Digest to store, hexadecimal.

        One round of SHA-256 is sufficient: the secret is 160 random bits, so it cannot be guessed from the
        digest as a password could. A slow hash would only slow down every request.
        """
        return hashlib.sha256(self._secret.encode()).hexdigest()

    def shown(self) -> str:
        """The complete key including the secret, for its owner."""
        return f"{PREFIX}{self.id}_{self._secret}"

    def __repr__(self) -> str:
        return f"Token({self.id})"


class Keys(Repository):
    """The keys of all tenants, for the command line and authentication."""

    def add(
        self, token: ApiKey, tenant: Tenant, name: str, scopes: Sequence[str], expires: float | None = None
    ) -> KeyRow:
        """Insert a key without its secret.

        Raises:
            InvalidInput: when the id exists, or the tenant is that of a user who signs in or a project.
        """
        row = {"id": token.id, "tenant": tenant, "name": name, "scopes": list(scopes)}
        made = {"sha256": token.digest(), "created": time.time(), "expires": expires}
        try:
            with self._database.write() as session:
                if GIVEN.fullmatch(tenant) or is_claimed(session, tenant):
                    accepted = "another name; for users and programs together, BENTRAY_OIDC_TENANTS"
                    raise InvalidInput("tenant", f"{tenant}, of a user who signs in or a project", accepted)
                session.execute(unclaiming([tenant]))
                session.add(KeyRow(**row, **made))
        except IntegrityError:
            raise InvalidInput("key", f"{token.id}, which exists", "a key with a new id") from None
        return self._row(token.id)

    def any(self) -> bool:
        """Whether a key exists or existed; authentication is required from then on."""
        return self._database.row(select(KeyRow.number).limit(1)) is not None

    def owner(self, token: ApiKey) -> KeyRow | None:
        """The row of a valid key; None if it is unknown, revoked or expired."""
        row = self._find(token.id)
        # Constant time, also for an unknown key.
        same = hmac.compare_digest(token.digest(), row.sha256 if row is not None else "0" * 64)
        now = time.time()
        if row is None or not same or row.revoked is not None:
            return None
        if row.expires is not None and row.expires <= now:
            return None
        if row.used is None or now - row.used > USED_S:
            try:
                self._database.change(update(KeyRow).where(KeyRow.id == token.id).values(used=now))
            except SQLAlchemyError as error:
                log.warning("the last use of key %s could not be stored: %s", token.id, error)
        return row

    def ended(self, key_ids: Sequence[str]) -> list[str]:
        """The keys among ``key_ids`` that are revoked or expired."""
        ended = or_(KeyRow.revoked.is_not(None), KeyRow.expires <= time.time())
        return self._database.rows(select(KeyRow.id).where(KeyRow.id.in_(key_ids), ended))

    def next_expiry(self) -> float | None:
        """When the next valid key expires, s since 1970; None if none does."""
        valid = KeyRow.revoked.is_(None), KeyRow.expires > time.time()
        return self._database.row(select(func.min(KeyRow.expires)).where(*valid))

    def all(self, tenant: Tenant | None = None) -> list[KeyRow]:
        """All keys, or those of one tenant, oldest first."""
        query = select(KeyRow).order_by(KeyRow.number)
        if tenant is not None:
            query = query.where(KeyRow.tenant == tenant)
        return self._database.rows(query)

    def revoke(self, key_id: str) -> KeyRow:
        """Revoke a key permanently.

        Raises:
            InvalidInput: when the id is unknown.
        """
        mine = update(KeyRow).where(KeyRow.id == key_id, KeyRow.revoked.is_(None))
        self._database.change(mine.values(revoked=time.time()))
        return self._row(key_id)

    def _row(self, key_id: str) -> KeyRow:
        row = self._find(key_id)
        if row is None:
            raise InvalidInput("key", repr(key_id[:80]), "the id of a key; see bentray keys list")
        return row

    def _find(self, key_id: str) -> KeyRow | None:
        return self._database.row(select(KeyRow).where(KeyRow.id == key_id))


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

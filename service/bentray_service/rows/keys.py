"""The table of API keys."""

from __future__ import annotations

import hmac
import logging
import time
from collections.abc import Sequence

from sqlalchemy import func, or_, select, update
from sqlalchemy.exc import IntegrityError, SQLAlchemyError

from bentray_kernels.errors import InvalidInput

from .api_key import ApiKey
from .claims import is_claimed, keep_from_claims
from .database import Database
from .tables import KeyRow
from .tenants import GIVEN, Tenant

log = logging.getLogger("bentray.access")

# Resolution of the stored time of last use, s; it avoids one write per request.
USED_S = 60.0


class Keys:
    """The keys of all tenants, for the command line and authentication."""

    def __init__(self, database: Database) -> None:
        self._database = database

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
                keep_from_claims(session, [tenant])
                session.add(KeyRow(**row, **made))
        except IntegrityError:
            raise InvalidInput("key", f"{token.id}, which exists", "a key with a new id") from None
        return self._row(token.id)

    def any(self) -> bool:
        """Whether a key exists or existed; authentication is required from then on."""
        with self._database.read() as session:
            return session.scalar(select(KeyRow.number).limit(1)) is not None

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
            self._note(token.id, now)
        return row

    def ended(self, key_ids: Sequence[str]) -> list[str]:
        """The keys among ``key_ids`` that are revoked or expired."""
        query = select(KeyRow.id).where(
            KeyRow.id.in_(key_ids), or_(KeyRow.revoked.is_not(None), KeyRow.expires <= time.time())
        )
        with self._database.read() as session:
            return list(session.scalars(query))

    def next_expiry(self) -> float | None:
        """When the next valid key expires, s since 1970; None if none does."""
        valid = KeyRow.revoked.is_(None), KeyRow.expires > time.time()
        with self._database.read() as session:
            return session.scalar(select(func.min(KeyRow.expires)).where(*valid))

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
        with self._database.write() as session:
            mine = update(KeyRow).where(KeyRow.id == key_id, KeyRow.revoked.is_(None))
            session.execute(mine.values(revoked=time.time()))
        return self._row(key_id)

    def _row(self, key_id: str) -> KeyRow:
        row = self._find(key_id)
        if row is None:
            raise InvalidInput("key", repr(key_id[:80]), "the id of a key; see bentray keys list")
        return row

    def _find(self, key_id: str) -> KeyRow | None:
        with self._database.read() as session:
            return session.scalar(select(KeyRow).where(KeyRow.id == key_id))

    def _note(self, key_id: str, now: float) -> None:
        try:
            with self._database.write() as session:
                session.execute(update(KeyRow).where(KeyRow.id == key_id).values(used=now))
        except SQLAlchemyError as error:
            log.warning("the last use of key %s could not be stored: %s", key_id, error)

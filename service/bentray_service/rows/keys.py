"""The rows of API keys: who holds the secret of one acts for its tenant."""

from __future__ import annotations

import hmac
import logging
import time
from collections.abc import Sequence
from typing import cast

from sqlalchemy import insert, or_, select, update
from sqlalchemy.exc import IntegrityError, SQLAlchemyError

from bentray_kernels.errors import InvalidInput

from .api_key import ApiKey
from .database import Database
from .records import KeyRow
from .schema import keys
from .tenants import Tenant

log = logging.getLogger("bentray.access")

# How exactly it is kept when a key was last used, s: a write for each request would be a slow one.
USED_S = 60.0


class Keys:
    """The keys of all tenants; only who can read the database gets at them, never a request."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def add(
        self, token: ApiKey, tenant: Tenant, name: str, scopes: Sequence[str], expires: float | None = None
    ) -> KeyRow:
        """Store a key, without its secret.

        Raises:
            InvalidInput: when there is one with this id.
        """
        row = {"id": token.id, "tenant": tenant, "name": name, "scopes": list(scopes)}
        made = {"sha256": token.digest(), "created": time.time(), "expires": expires}
        try:
            with self._database.write() as connection:
                connection.execute(insert(keys).values(**row, **made))
        except IntegrityError:
            raise InvalidInput("key", f"{token.id}, which exists", "one with an id of its own") from None
        return self._row(token.id)

    def any(self) -> bool:
        """Whether there is, or was, a key: from then on one is asked for."""
        with self._database.read() as connection:
            return connection.execute(select(keys.c.number).limit(1)).first() is not None

    def owner(self, token: ApiKey) -> KeyRow | None:
        """The row of a key that is valid now; None for one that is unknown, revoked or expired."""
        row = self._find(token.id)
        # Compared in constant time, and against nothing as long as against something.
        same = hmac.compare_digest(token.digest(), row["sha256"] if row is not None else "0" * 64)
        now = time.time()
        if row is None or not same or row["revoked"] is not None:
            return None
        if row["expires"] is not None and row["expires"] <= now:
            return None
        if row["used"] is None or now - row["used"] > USED_S:
            self._note(token.id, now)
        return row

    def ended(self, key_ids: Sequence[str]) -> list[str]:
        """Those of some keys that are not valid any more."""
        query = select(keys.c.id).where(
            keys.c.id.in_(key_ids), or_(keys.c.revoked.is_not(None), keys.c.expires <= time.time())
        )
        with self._database.read() as connection:
            return list(connection.execute(query).scalars())

    def all(self, tenant: Tenant | None = None) -> list[KeyRow]:
        """Every key, or those of one tenant, oldest first."""
        query = select(keys).order_by(keys.c.number)
        if tenant is not None:
            query = query.where(keys.c.tenant == tenant)
        return cast(list[KeyRow], self._database.rows(query))

    def revoke(self, key_id: str) -> KeyRow:
        """End a key for good, at once.

        Raises:
            InvalidInput: when there is none with this id.
        """
        with self._database.write() as connection:
            mine = update(keys).where(keys.c.id == key_id, keys.c.revoked.is_(None))
            connection.execute(mine.values(revoked=time.time()))
        return self._row(key_id)

    def _row(self, key_id: str) -> KeyRow:
        row = self._find(key_id)
        if row is None:
            raise InvalidInput("key", repr(key_id[:80]), "the id of a key; see bentray keys list")
        return row

    def _find(self, key_id: str) -> KeyRow | None:
        found = self._database.rows(select(keys).where(keys.c.id == key_id))
        return cast(KeyRow, found[0]) if found else None

    def _note(self, key_id: str, now: float) -> None:
        try:
            with self._database.write() as connection:
                connection.execute(update(keys).where(keys.c.id == key_id).values(used=now))
        except SQLAlchemyError:
            log.warning("when key %s was used could not be stored", key_id, exc_info=True)

"""API keys: their format, and their table; secrets are never stored."""

from __future__ import annotations

import hashlib
import hmac
import logging
import re
import secrets
import time
from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import func, or_, select, update
from sqlalchemy.exc import IntegrityError, SQLAlchemyError

from bentray_kernels.errors import InvalidInput

from .claims import is_claimed, unclaiming
from .database import Repository
from .ids import GIVEN, Tenant
from .tables import KeyRow

PREFIX = "bentray_"
ACCEPTED = "bentray_, 12 hexadecimal digits, _ and 40 more"

# Also used to remove keys from logs.
PATTERN = re.compile(r"bentray_([0-9a-f]{12})_([0-9a-f]{40})")
# Resolution of the stored time of last use, s; it avoids one write per request.
USED_S = 60.0


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


log = logging.getLogger("bentray.access")


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

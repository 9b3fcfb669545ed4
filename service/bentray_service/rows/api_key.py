"""The form of an API key: made here, taken apart here, and never stored."""

from __future__ import annotations

import hashlib
import re
import secrets
from dataclasses import dataclass

from bentray_kernels.errors import InvalidInput

PREFIX = "bentray_"
ACCEPTED = "bentray_, 12 hexadecimal digits, _ and 40 more"

# Also what logs are searched for.
PATTERN = re.compile(r"bentray_([0-9a-f]{12})_([0-9a-f]{40})")


@dataclass(frozen=True, repr=False)
class ApiKey:
    """A key as its owner holds it; it shows itself to nobody by accident.

    Attributes:
        id: names the key, and is no secret.
    """

    id: str
    _secret: str

    @classmethod
    def new(cls) -> ApiKey:
        """A key that nobody has."""
        return cls(secrets.token_hex(6), secrets.token_hex(20))

    @classmethod
    def of(cls, text: str) -> ApiKey | None:
        """The key that ``text`` is, if it has the form of one."""
        found = PATTERN.fullmatch(text)
        return None if found is None else cls(found[1], found[2])

    @classmethod
    def given(cls, field: str, text: str) -> ApiKey:
        """The same.

        Raises:
            InvalidInput: naming ``field``, and not what was found, which may be a secret with a slip.
        """
        found = cls.of(text)
        if found is None:
            raise InvalidInput(field, f"{len(text)} characters that are no key", ACCEPTED)
        return found

    def digest(self) -> str:
        """What is stored of it, hexadecimal.

        One round of SHA-256 is enough: the secret is 160 random bits, so who has the digests cannot try his
        way back, as he could with what people think up; a slow hash would only make every request slow.
        """
        return hashlib.sha256(self._secret.encode()).hexdigest()

    def shown(self) -> str:
        """The whole key, for its owner."""
        return f"{PREFIX}{self.id}_{self._secret}"

    def __repr__(self) -> str:
        return f"Token({self.id})"

"""API keys: format, creation and parsing; the secret is never stored."""

from __future__ import annotations

import hashlib
import re
import secrets
from dataclasses import dataclass

from bentray_kernels.errors import InvalidInput

PREFIX = "bentray_"
ACCEPTED = "bentray_, 12 hexadecimal digits, _ and 40 more"

# Also used to remove keys from logs.
PATTERN = re.compile(r"bentray_([0-9a-f]{12})_([0-9a-f]{40})")


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

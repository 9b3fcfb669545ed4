"""Tenants: the owners of all data, as a type of its own."""

from __future__ import annotations

import re
from typing import NewType

from bentray_kernels.errors import InvalidInput

# A folder has this name, so it must not contain path separators.
PATTERN = re.compile(r"[a-z0-9][a-z0-9._@+-]{0,63}")
ACCEPTED = "1 to 64 of a-z, 0-9 and . _ @ + -, beginning with a letter or digit"

# Names that nobody chooses: of claimed names, and of projects, whose id is the tenant of their items.
GIVEN = re.compile(r"user-[0-9a-f]{40}|project-[0-9a-f]{20}")

Tenant = NewType("Tenant", str)

# The owner of all data when authentication is not required.
LOCAL = Tenant("local")


def checked_tenant(text: str) -> Tenant:
    """Return ``text`` if it is a valid tenant name.

    Raises:
        InvalidInput: otherwise.
    """
    if not PATTERN.fullmatch(text):
        raise InvalidInput("tenant", repr(text[:80]), ACCEPTED)
    return Tenant(text)

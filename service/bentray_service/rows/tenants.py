"""Tenants: whose everything is, as a type of its own, so that no other string passes for one."""

from __future__ import annotations

import hashlib
import re
from typing import NewType

from bentray_kernels.errors import InvalidInput

# A folder is named by it, so it holds nothing that a path would read.
PATTERN = re.compile(r"[a-z0-9][a-z0-9._@+-]{0,63}")
ACCEPTED = "1 to 64 of a-z, 0-9 and . _ @ + -, beginning with a letter or digit"

# Names that are made from others below; nobody can be called so.
_DIGEST = re.compile(r"user-[0-9a-f]{40}")

Tenant = NewType("Tenant", str)

# Whose everything is where no key is asked for.
LOCAL = Tenant("local")


def checked_tenant(text: str) -> Tenant:
    """``text`` if it can name a tenant.

    Raises:
        InvalidInput: otherwise.
    """
    if not PATTERN.fullmatch(text):
        raise InvalidInput("tenant", repr(text[:80]), ACCEPTED)
    return Tenant(text)


def tenant_of_user(user: str) -> Tenant:
    """The tenant of whoever a proxy calls ``user``: the name itself, or a digest of one that cannot be it.

    Two users never share a tenant, and none becomes ``LOCAL``.
    """
    if PATTERN.fullmatch(user) and user != LOCAL and not _DIGEST.fullmatch(user):
        return Tenant(user)
    return Tenant(f"user-{hashlib.sha256(user.encode()).hexdigest()[:40]}")

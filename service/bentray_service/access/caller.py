"""The authenticated caller of a request: tenant and scopes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from bentray_kernels.errors import InvalidInput

from ..rows.tenants import LOCAL, Tenant

# Permissions of each scope.
SCOPES: Mapping[str, str] = MappingProxyType(
    {
        "read": "read all data of the tenant, including images and files",
        "write": "upload, start, cancel and delete",
        "metrics": "read /metrics, which covers all tenants",
    }
)
USUAL = ("read", "write")
METRICS = "/metrics"


@dataclass(frozen=True)
class Caller:
    """The authenticated caller.

    Attributes:
        tenant: whose data it accesses.
        how: method of authentication: ``open`` (not required), ``key``, ``proxy`` or ``session``.
        who: id of the key, or user name from the proxy or the OpenID provider.
        scopes: permissions.
        ends: id of the key or session whose end ends its requests; empty if there is none.
    """

    tenant: Tenant
    how: Literal["open", "key", "proxy", "session"]
    who: str
    scopes: frozenset[str]
    ends: str = ""


ANYONE = Caller(LOCAL, "open", "", frozenset(SCOPES))


def scope_of(method: str, path: str) -> str:
    """The scope required by a request."""
    if path == METRICS:
        return "metrics"
    return "read" if method in ("GET", "HEAD", "OPTIONS") else "write"


def checked_scopes(words: str) -> tuple[str, ...]:
    """Parse scopes separated by commas.

    Raises:
        InvalidInput: naming an unknown scope.
    """
    scopes = tuple(dict.fromkeys(word.strip() for word in words.split(",")))
    for scope in scopes:
        if scope not in SCOPES:
            accepted = "; ".join(f"{name}: {meaning}" for name, meaning in SCOPES.items())
            raise InvalidInput("scopes", repr(scope[:40]), accepted)
    return scopes

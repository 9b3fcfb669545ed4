"""The caller of a request: which tenant it acts for, and what it may do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from bentray_kernels.errors import InvalidInput

from ..rows.tenants import LOCAL, Tenant

# What each scope allows; few, so that one can say what a key can do.
SCOPES: Mapping[str, str] = MappingProxyType(
    {
        "read": "look at everything of the tenant, pictures and files too",
        "write": "upload, start, cancel and delete",
        "metrics": "read /metrics, which tells of all tenants together",
    }
)
USUAL = ("read", "write")
METRICS = "/metrics"


@dataclass(frozen=True)
class Caller:
    """Who asks.

    Attributes:
        tenant: for whom.
        how: by what it is known: ``open`` where nobody is asked for a key, ``key`` or ``proxy``.
        who: the id of the key, or the user that the proxy named.
        scopes: what it may do.
    """

    tenant: Tenant
    how: Literal["open", "key", "proxy"]
    who: str
    scopes: frozenset[str]


ANYONE = Caller(LOCAL, "open", "", frozenset(SCOPES))


def scope_of(method: str, path: str) -> str:
    """The scope that a request needs."""
    if path == METRICS:
        return "metrics"
    return "read" if method in ("GET", "HEAD", "OPTIONS") else "write"


def checked_scopes(words: str) -> tuple[str, ...]:
    """The scopes in a list with commas.

    Raises:
        InvalidInput: naming the one that there is not.
    """
    found = tuple(dict.fromkeys(word.strip() for word in words.split(",")))
    for scope in found:
        if scope not in SCOPES:
            accepted = "; ".join(f"{name}: {meaning}" for name, meaning in SCOPES.items())
            raise InvalidInput("scopes", repr(scope[:40]), accepted)
    return found

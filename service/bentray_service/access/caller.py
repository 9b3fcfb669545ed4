"""The authenticated caller of a request: tenant and scopes."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from bentray_kernels.errors import InvalidInput

from ..rows.ids import LOCAL, Tenant

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
        tenant: whose data it accesses; in a project, its id.
        how: method of authentication: ``open`` (not required), ``key``, ``proxy`` or ``session``.
        who: id of the key, or user name from the proxy or the OpenID provider.
        scopes: permissions.
        ends: ids of the key or session and of the membership whose end ends its requests.
        project: id of the project in which it acts; empty outside of projects.
        role: in this project.
        owner: tenant of this project.
    """

    tenant: Tenant
    how: Literal["open", "key", "proxy", "session"]
    who: str
    scopes: frozenset[str]
    ends: tuple[str, ...] = ()
    project: str = ""
    role: str = ""
    owner: Tenant | None = None

    @property
    def home(self) -> Tenant:
        """The tenant, also in one of its projects."""
        return self.tenant if self.owner is None else self.owner

    @property
    def member(self) -> str | None:
        """The name of a member of projects; None without authentication, when everything is allowed."""
        if self.how == "open":
            return None
        return f"{'key' if self.how == 'key' else 'user'}:{self.who}"


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

"""From the claims of an OpenID provider about a user to tenant, name and scopes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from bentray_kernels.errors import InvalidInput

from ..errors import Forbidden
from ..rows.claims import ClaimedTenants
from ..rows.ids import Tenant, checked_tenant
from ..settings import ServiceSettings
from .caller import USUAL, checked_scopes

LONGEST_USER = 200
# OpenID Connect Core, 2.
LONGEST_SUBJECT = 255

Checked = TypeVar("Checked")


@dataclass(frozen=True)
class Identity:
    """A user as the service knows it."""

    tenant: Tenant
    who: str
    scopes: tuple[str, ...]


class ClaimMapping:
    """The rules of the settings from claims to an identity.

    Only the settings name tenants. A name in a claim has a tenant of its own, which never is that of a key.
    """

    def __init__(self, settings: ServiceSettings, claimed: ClaimedTenants) -> None:
        """Raises:
        InvalidInput: for an invalid tenant or scope in the settings.
        """
        self._claimed, self._issuer = claimed, settings.oidc_issuer or ""
        self._user = settings.oidc_user_claim
        self._tenant = settings.oidc_tenant_claim
        self._role = settings.oidc_role_claim
        self._tenants = {
            value: _checked("OIDC_TENANTS", checked_tenant, tenant)
            for value, tenant in (settings.oidc_tenants or {}).items()
        }
        self._roles = {
            value: _checked("OIDC_ROLES", checked_scopes, scopes)
            for value, scopes in (settings.oidc_roles or {}).items()
        }
        for name, table, claim in (
            ("TENANT", self._tenants, self._tenant),
            ("ROLE", self._roles, self._role),
        ):
            if table and claim is None:
                raise InvalidInput(f"BENTRAY_OIDC_{name}_CLAIM", "nothing", "the claim that the table reads")
        claimed.keep_from_claims([*self._tenants.values()])

    def names(self) -> tuple[str, ...]:
        """The claims that must be known."""
        used = [one for one in (self._user, self._tenant, self._role) if one is not None]
        return (*used, *(["email_verified"] if "email" in used else []))

    def identity(self, claims: Mapping[str, Any]) -> Identity:
        """The identity of a user.

        Args:
            claims: of the provider, verified.

        Raises:
            Forbidden: without a tenant or a role for the user.
        """
        users = values_of(claims, self._user)
        if len(users) != 1:
            raise Forbidden(
                self._user, _shown(users), "one name of the user: printable text, nothing around it"
            )
        # Longer ones are cut where they are stored, and could then be those of another user.
        if len(users[0]) > LONGEST_USER:
            raise Forbidden(self._user, f"{len(users[0])} characters", f"at most {LONGEST_USER}")
        verified = claims.get("email_verified")
        # Nothing else, also no text: whoever may write any address at the provider is not its owner.
        if "email" in (self._user, self._tenant, self._role) and verified is not True:
            found = repr(verified)[:40] if "email_verified" in claims else "nothing"
            raise Forbidden("email_verified", found, "true: an address that the provider has verified")
        return Identity(self._tenant_of(users[0], claims), users[0], self._scopes(claims))

    def _tenant_of(self, user: str, claims: Mapping[str, Any]) -> Tenant:
        if self._tenant is None:
            # Not by the claim that names the user: providers give names and addresses to others.
            subjects = values_of(claims, "sub")
            if len(subjects) != 1 or len(subjects[0]) > LONGEST_SUBJECT:
                raise Forbidden(
                    "sub", _shown(subjects), f"one subject, of at most {LONGEST_SUBJECT} characters"
                )
            return self._claimed.tenant(self._issuer, "sub", subjects[0], user)
        values = values_of(claims, self._tenant)
        if self._tenants:
            # The order of the settings decides, not that of the provider.
            for value, tenant in self._tenants.items():
                if value in values:
                    return tenant
            raise Forbidden(self._tenant, _shown(values), "a group that may use this service")
        if len(values) != 1 or len(values[0]) > LONGEST_USER:
            raise Forbidden(self._tenant, _shown(values), f"one tenant, of at most {LONGEST_USER} characters")
        return self._claimed.tenant(self._issuer, self._tenant, values[0], values[0])

    def _scopes(self, claims: Mapping[str, Any]) -> tuple[str, ...]:
        if not self._roles or self._role is None:
            return USUAL
        values = values_of(claims, self._role)
        scopes = [scope for value in values for scope in self._roles.get(value, ())]
        if not scopes:
            raise Forbidden(self._role, _shown(values), "a role that may use this service")
        return tuple(dict.fromkeys(scopes))


def values_of(claims: Mapping[str, Any], name: str) -> tuple[str, ...]:
    """The texts of a claim: one, or a list; a name with dots leads into nested claims.

    A claim whose own name has dots, as an address, comes first. Texts that are empty, or have space around or
    characters inside that are not shown, are left out: they would look like those of another user.
    """
    found: Any = claims.get(name)
    if found is None:
        found = claims
        for part in name.split("."):
            found = found.get(part) if isinstance(found, Mapping) else None
    if isinstance(found, str):
        found = [found]
    if not isinstance(found, list):
        return ()
    return tuple(
        one for one in found if isinstance(one, str) and one and one.isprintable() and one == one.strip()
    )


def _shown(values: tuple[str, ...]) -> str:
    return repr(", ".join(values))[:120] if values else "nothing"


def _checked(name: str, check: Callable[[str], Checked], text: str) -> Checked:
    try:
        return check(text)
    except InvalidInput as error:
        raise InvalidInput(f"BENTRAY_{name}", error.value, error.accepted) from None

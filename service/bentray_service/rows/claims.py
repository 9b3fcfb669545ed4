"""The table of the tenants of claimed names, of users and groups that a provider or a proxy reports."""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Collection

from sqlalchemy import Delete, delete, select, update
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from .database import Database, Repository, rows_changed
from .ids import GIVEN, LOCAL, TENANT_PATTERN, Tenant
from .tables import ClaimedTenantRow

log = logging.getLogger("bentray.access")


def former_tenant(user: str) -> Tenant:
    """The tenant of a user before version 13 of the database: the name itself, or its digest if not valid."""
    if TENANT_PATTERN.fullmatch(user) and user != LOCAL and not GIVEN.fullmatch(user):
        return Tenant(user)
    return Tenant(f"user-{hashlib.sha256(user.encode()).hexdigest()[:40]}")


class ClaimedTenants(Repository):
    """Gives each name of a user or group that a provider or a proxy reports a tenant of its own.

    No key and no other name has it, and the name has the same one at all times.
    """

    def __init__(self, database: Database) -> None:
        super().__init__(database)
        self._known: dict[tuple[str, str, str], Tenant] = {}

    def tenant(self, issuer: str, claim: str, value: str, before: str) -> Tenant:
        """The tenant of a name; stored at its first use.

        Args:
            issuer: who says it: of the provider, or ``proxy``.
            claim: its claim or header.
            value: the name.
            before: from which versions before 13 of the database made the name of the tenant.
        """
        name = (issuer, claim, value)
        if name not in self._known:
            try:
                self._known[name] = self._find(name) or self._add(name, former_tenant(before))
            except IntegrityError:
                # Another service on this database was first.
                self._known[name] = Tenant(self._find(name) or "")
        return self._known[name]

    def keep_from_claims(self, tenants: Collection[Tenant]) -> None:
        """Tenants that the operator has named are never given to a claimed name of before."""
        self._database.change(unclaiming(tenants))

    def _find(self, name: tuple[str, str, str]) -> Tenant | None:
        named = {"issuer": name[0], "claim": name[1], "value": name[2]}
        return self._database.row(select(ClaimedTenantRow.tenant).filter_by(**named))

    def _add(self, name: tuple[str, str, str], former: Tenant) -> Tenant:
        row = dict(zip(("issuer", "claim", "value"), name, strict=True))
        unclaimed = update(ClaimedTenantRow).filter_by(issuer="", tenant=former)
        tenant = Tenant(f"user-{hashlib.sha256(json.dumps(name).encode()).hexdigest()[:40]}")
        with self._database.write() as session:
            if rows_changed(session, unclaimed.values(**row)):
                log.warning("%s of %s keeps the tenant %s, which an earlier version gave", *name[1:], former)
                return former
            session.add(ClaimedTenantRow(tenant=tenant, **row))
        return tenant


def is_claimed(session: Session, tenant: Tenant) -> bool:
    """Whether a claimed name has this tenant."""
    claimed = ClaimedTenantRow.tenant == tenant, ClaimedTenantRow.issuer != ""
    return session.scalar(select(ClaimedTenantRow.number).where(*claimed)) is not None


def unclaiming(tenants: Collection[Tenant]) -> Delete:
    """The statement of ``ClaimedTenants.keep_from_claims``."""
    return delete(ClaimedTenantRow).where(ClaimedTenantRow.issuer == "", ClaimedTenantRow.tenant.in_(tenants))

"""The table of tenants of claimed names: of users and groups that a provider or a proxy reports."""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Collection

from sqlalchemy import Connection, delete, insert, select, update
from sqlalchemy.exc import IntegrityError

from .database import Database
from .schema import claimed_tenants
from .tenants import Tenant, former_tenant

log = logging.getLogger("bentray.access")


class ClaimedTenants:
    """Gives each claimed name a tenant that no key and no other name has, the same one at all times."""

    def __init__(self, database: Database) -> None:
        self._database = database
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
        with self._database.write() as connection:
            keep_from_claims(connection, tenants)

    def _find(self, name: tuple[str, str, str]) -> Tenant | None:
        table = claimed_tenants.c
        query = select(table.tenant).where(
            table.issuer == name[0], table.claim == name[1], table.value == name[2]
        )
        with self._database.read() as connection:
            found = connection.execute(query).scalar_one_or_none()
        return None if found is None else Tenant(found)

    def _add(self, name: tuple[str, str, str], former: Tenant) -> Tenant:
        table = claimed_tenants.c
        row = dict(zip(("issuer", "claim", "value"), name, strict=True))
        unclaimed = update(claimed_tenants).where(table.issuer == "", table.tenant == former)
        tenant = Tenant(f"user-{hashlib.sha256(json.dumps(name).encode()).hexdigest()[:40]}")
        with self._database.write() as connection:
            if connection.execute(unclaimed.values(**row)).rowcount:
                log.warning("%s of %s keeps the tenant %s, which an earlier version gave", *name[1:], former)
                return former
            connection.execute(insert(claimed_tenants).values(tenant=tenant, **row))
        return tenant


def is_claimed(connection: Connection, tenant: Tenant) -> bool:
    """Whether a claimed name has this tenant."""
    table = claimed_tenants.c
    query = select(table.number).where(table.tenant == tenant, table.issuer != "")
    return connection.execute(query).first() is not None


def keep_from_claims(connection: Connection, tenants: Collection[Tenant]) -> None:
    """As ``ClaimedTenants.keep_from_claims``."""
    table = claimed_tenants.c
    connection.execute(delete(claimed_tenants).where(table.issuer == "", table.tenant.in_(tenants)))

"""Tenants: the owners of all data, as a type of its own, and the table of those of claimed names."""

from __future__ import annotations

import hashlib
import json
import logging
import re
from collections.abc import Collection
from typing import NewType

from sqlalchemy import Connection, delete, insert, select, update
from sqlalchemy.exc import IntegrityError

from bentray_kernels.errors import InvalidInput

from .database import Database
from .schema import claimed_tenants

log = logging.getLogger("bentray.access")

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


def former_tenant(user: str) -> Tenant:
    """The tenant of a user before version 13 of the database: the name itself, or its digest if not valid."""
    if PATTERN.fullmatch(user) and user != LOCAL and not GIVEN.fullmatch(user):
        return Tenant(user)
    return Tenant(f"user-{hashlib.sha256(user.encode()).hexdigest()[:40]}")


class ClaimedTenants:
    """Gives each name of a user or group that a provider or a proxy reports a tenant of its own.

    No key and no other name has it, and the name has the same one at all times.
    """

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

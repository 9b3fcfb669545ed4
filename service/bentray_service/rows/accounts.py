"""Accounts: the only key of limits, each of which counts a tenant together with its projects."""

from __future__ import annotations

from typing import NewType

from sqlalchemy import ColumnElement, Connection, func, select

from .database import Database
from .schema import projects
from .tenants import Tenant

# A tenant with all its projects. Limits are counted by account and rows are owned by tenant: the two types
# keep a limit from being counted for a project.
Account = NewType("Account", str)


def account_of(connection: Connection, tenant: Tenant) -> Account:
    """The account of a tenant or project."""
    owner = connection.execute(select(projects.c.tenant).where(projects.c.id == tenant)).scalar_one_or_none()
    return Account(owner or tenant)


def account_in(tenant: ColumnElement[str]) -> ColumnElement[str]:
    """The same for a column of tenants, in a query."""
    owner = select(projects.c.tenant).where(projects.c.id == tenant)
    # Otherwise the table of a query two levels up would be joined again.
    return func.coalesce(owner.correlate_except(projects).scalar_subquery(), tenant)


def family_of(connection: Connection, tenant: Tenant) -> list[Tenant]:
    """The tenants of an account: itself, which comes first, and its projects."""
    account = account_of(connection, tenant)
    mine = select(projects.c.id).where(projects.c.tenant == account).order_by(projects.c.number)
    return [Tenant(account), *(Tenant(one) for one in connection.execute(mine).scalars())]


class Accounts:
    """Accounts of tenants outside of transactions.

    The account of a tenant never changes, and ids of projects are not used again: each is read once.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        self._known: dict[Tenant, Account] = {}

    def of(self, tenant: Tenant) -> Account:
        """The account of a tenant or project. Of the caller of a request it is known since the sign-in."""
        known = self._known.get(tenant)
        if known is None:
            with self._database.read() as connection:
                known = account_of(connection, tenant)
            self._known[tenant] = known
        return known

"""Accounts: the only key of limits, each of which counts a tenant together with its projects."""

from typing import NewType

from sqlalchemy import ColumnElement, SQLColumnExpression, func, select
from sqlalchemy.orm import Session

from .database import Database, Repository
from .ids import Tenant
from .tables import ProjectRow

# A tenant with all its projects. Limits are counted by account and rows are owned by tenant: the two types
# keep a limit from being counted for a project.
Account = NewType("Account", str)


def account_of(session: Session, tenant: Tenant) -> Account:
    """The account of a tenant or project."""
    return Account(session.scalar(select(ProjectRow.tenant).where(ProjectRow.id == tenant)) or tenant)


def account_in(tenant: SQLColumnExpression[Tenant]) -> ColumnElement[str]:
    """Account for a column of tenants, in a query."""
    owner = select(ProjectRow.tenant).where(ProjectRow.id == tenant)
    # Otherwise the table of a query two levels up would be joined again.
    return func.coalesce(owner.correlate_except(ProjectRow).scalar_subquery(), tenant)


def family_of(session: Session, tenant: Tenant) -> list[Tenant]:
    """The tenants of an account: itself, which comes first, and its projects."""
    account = account_of(session, tenant)
    mine = select(ProjectRow.id).where(ProjectRow.tenant == account).order_by(ProjectRow.number)
    return [Tenant(account), *(Tenant(project) for project in session.scalars(mine))]


class Accounts(Repository):
    """Accounts of tenants outside of transactions.

    The account of a tenant never changes, and ids of projects are not used again: each is read once.
    """

    def __init__(self, database: Database) -> None:
        super().__init__(database)
        self._known: dict[Tenant, Account] = {}

    def of(self, tenant: Tenant) -> Account:
        """The account of a tenant or project. Of the caller of a request it is known since the sign-in."""
        known = self._known.get(tenant)
        if known is None:
            with self._database.read() as session:
                known = account_of(session, tenant)
            self._known[tenant] = known
        return known

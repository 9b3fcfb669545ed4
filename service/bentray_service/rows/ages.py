"""The rows of what is older than it may become: marked first, and gone only if it stays so."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

from sqlalchemy import delete, insert, select

from .database import Database
from .schema import too_old
from .tenants import Tenant


class ExpiredItem(NamedTuple):
    """Something that has an age; ``what`` is ``dataset``, ``volume``, ``mesh``, ``job`` or ``upload``."""

    tenant: Tenant
    what: str
    id: str


class ExpiryMarks:
    """Marks what was found to be too old, with the time observed by then, see :class:`ObservedTime`.

    The clock of the machine, by which ages are told, may be wrong for a while; so nothing goes before its age
    has been found again and again for long enough.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def mark(self, found: Collection[ExpiredItem], observed_s: float) -> dict[ExpiredItem, float]:
        """Mark all that is too old now, and take back the marks of what is not any more.

        Args:
            found: everything that is too old, of every kind.
            observed_s: the time observed by now, s.

        Returns:
            for how long each of them has been found too old, s.
        """
        now = set(found)
        with self._database.write() as connection:
            rows = connection.execute(select(too_old)).all()
            marked = {ExpiredItem(Tenant(row.tenant), row.what, row.id): row.noticed_s for row in rows}
            for one in marked.keys() - now:
                mine = too_old.c.tenant == one.tenant, too_old.c.id == one.id
                connection.execute(delete(too_old).where(*mine))
            fresh = [{**one._asdict(), "noticed_s": observed_s} for one in now - marked.keys()]
            if fresh:
                connection.execute(insert(too_old), fresh)
        return {one: observed_s - marked.get(one, observed_s) for one in now}

    def clear(self) -> None:
        """Take back every mark: the clock by which ages were told was wrong, or is."""
        with self._database.write() as connection:
            connection.execute(delete(too_old))

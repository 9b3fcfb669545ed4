"""Changes of the state of a job: an update and an appended event in the transaction of the caller.

When a job ends, its reserved storage is released, and a message to its webhook is stored.
"""

from __future__ import annotations

import time
from typing import Any

from sqlalchemy import ColumnElement, Connection, delete, insert, select, update

from . import schema
from .deliveries import announce
from .schema import ENDED, jobs, storage

RUNNING = ("running", "cancelling")


def change(
    connection: Connection,
    job_id: str,
    before: tuple[str, ...],
    after: str,
    note: str = "",
    only: ColumnElement[bool] | None = None,
    **values: Any,
) -> bool:
    """Change the state if it is one of ``before`` and ``only`` holds; returns whether it was changed."""
    where = [jobs.c.id == job_id, jobs.c.state.in_(before)]
    if only is not None:
        where.append(only)
    changed = connection.execute(update(jobs).where(*where).values(state=after, **values))
    if changed.rowcount:
        append_event(connection, job_id, after, note)
        if after in ENDED:
            announce(connection, job_id, after)
            mine = select(jobs.c.tenant).where(jobs.c.id == job_id).scalar_subquery()
            reserved = storage.c.tenant == mine, storage.c.name == job_id, storage.c.reserved
            connection.execute(delete(storage).where(*reserved))
    return bool(changed.rowcount)


def append_event(connection: Connection, job_id: str, state: str, note: str = "") -> None:
    """Append an event."""
    connection.execute(insert(schema.events).values(job_id=job_id, time=time.time(), state=state, note=note))

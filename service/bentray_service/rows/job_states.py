"""Changes of the state of a job: an update and an appended event in the transaction of the caller.

When a job ends, its reserved storage is released, and a message to its webhook is stored.
"""

from __future__ import annotations

import time
from typing import Any

from sqlalchemy import ColumnElement, delete, select, update
from sqlalchemy.orm import Session

from .database import rows_changed
from .deliveries import announce
from .tables import ENDED, EventRow, JobRow, StorageRow

RUNNING = ("running", "cancelling")


def change(
    session: Session,
    job_id: str,
    before: tuple[str, ...],
    after: str,
    note: str = "",
    only: ColumnElement[bool] | None = None,
    **values: Any,
) -> bool:
    """Change the state if it is one of ``before`` and ``only`` holds; returns whether it was changed."""
    where = [JobRow.id == job_id, JobRow.state.in_(before)]
    if only is not None:
        where.append(only)
    changed = rows_changed(session, update(JobRow).where(*where).values(state=after, **values))
    if changed:
        append_event(session, job_id, after, note)
        if after in ENDED:
            announce(session, job_id, after)
            owner = select(JobRow.tenant).where(JobRow.id == job_id).scalar_subquery()
            reserved = StorageRow.tenant == owner, StorageRow.name == job_id, StorageRow.reserved
            session.execute(delete(StorageRow).where(*reserved))
    return bool(changed)


def append_event(session: Session, job_id: str, state: str, note: str = "") -> None:
    """Append an event."""
    session.add(EventRow(job_id=job_id, time=time.time(), state=state, note=note))

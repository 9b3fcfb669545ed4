"""States of jobs: changes with their events, and the order in which accounts take turns."""

import math
import time
from functools import cache
from typing import Any, NamedTuple

from sqlalchemy import (
    ColumnElement,
    Select,
    String,
    bindparam,
    case,
    delete,
    func,
    or_,
    select,
    union,
    update,
)
from sqlalchemy.orm import Session, aliased

from .accounts import Account, account_in
from .database import rows_changed
from .deliveries import announce
from .ids import Tenant
from .tables import ENDED, EventRow, JobRow, ProjectRow, StorageRow

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


class Turn(NamedTuple):
    """Turn of an account; smaller ones go first. An account without any job goes before those with one.

    Attributes:
        running: number of running jobs.
        served: start of the job that started last, s since 1970.
        oldest: number of the oldest queued job.
        queued: number of queued jobs.
        tenants: owners of the queued jobs, the account itself and its projects.
    """

    running: int = 0
    served: float = 0.0
    oldest: float = math.inf
    queued: int = 0
    tenants: tuple[Tenant, ...] = ()


def turns_of(session: Session, further: Account | None = None) -> dict[Account, Turn]:
    """Turns of all accounts with queued jobs, and of a ``further`` one."""
    turns: dict[Account, Turn] = {} if further is None else {further: Turn()}
    rows = session.execute(_query(further=further is not None), {"further": further})
    for account, tenant, waits, busy, last, first in rows:
        before = turns.get(Account(account), Turn())
        turns[Account(account)] = Turn(
            before.running + int(busy),
            max(before.served, float(last)),
            min(before.oldest, math.inf if first is None else first),
            before.queued + int(waits),
            (*before.tenants, Tenant(tenant)) if waits else before.tenants,
        )
    return turns


@cache
def _query(*, further: bool) -> Select[str, Tenant, int, int, float, int | None]:
    """Counts of each tenant; composed once, since every claim of a job needs it."""
    there = aliased(JobRow)
    waiting = select(account_in(there.tenant)).where(there.state == "queued")
    accounts = union(waiting, select(bindparam("further", type_=String))) if further else waiting
    of_them = or_(
        JobRow.tenant.in_(accounts),
        JobRow.tenant.in_(select(ProjectRow.id).where(ProjectRow.tenant.in_(accounts))),
    )
    queued, running = (
        func.coalesce(func.sum(case((JobRow.state.in_(states), 1), else_=0)), 0)
        for states in (("queued",), RUNNING)
    )
    served = func.coalesce(func.max(JobRow.started), 0.0)
    oldest = func.min(case((JobRow.state == "queued", JobRow.number)))
    each = select(account_in(JobRow.tenant), JobRow.tenant, queued, running, served, oldest)
    return each.where(of_them).group_by(JobRow.tenant)

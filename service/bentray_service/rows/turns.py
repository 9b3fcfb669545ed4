"""Turns of accounts: the order in which queued jobs start, for the queue and for positions in it."""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

from sqlalchemy import Select, String, bindparam, case, func, or_, select, union
from sqlalchemy.orm import Session, aliased

from .accounts import Account, account_in
from .job_states import RUNNING
from .tables import JobRow, ProjectRow
from .tenants import Tenant


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

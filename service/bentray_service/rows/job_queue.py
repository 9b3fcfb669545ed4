"""The job queue of all tenants, used by the job runner of the service."""

from __future__ import annotations

import secrets
import time
from collections import Counter
from collections.abc import Collection
from typing import Any, cast

from sqlalchemy import ColumnElement, Connection, and_, case, func, insert, or_, select, update

from . import schema, usage
from .accounts import Account, account_in
from .database import Database
from .job_states import RUNNING, change
from .schema import ENDED, jobs, volumes
from .tenants import Tenant
from .turns import turns_of
from .typed_rows import JobRow, Plain

MAX_ATTEMPTS = 3

# Time after which a service that does not renew its lease is considered dead, s.
LEASE_S = 30.0


class Queue:
    """Job states from ``queued`` through ``running`` (and ``cancelling``) to the end.

    A service that claims a job holds a lease, which it renews while it is alive. A service that has lost its
    lease no longer changes the job.
    """

    def __init__(self, database: Database, installation: str | None = None) -> None:
        """Args:
        database: with the jobs.
        installation: the id of the data folder that this process has locked (``installation_of``). Leases of
            the same id belong to dead processes and are taken over at once. None: leases must expire.
        """
        self._database = database
        self._prefix = f"{installation or secrets.token_hex(8)}-"
        self._owner = self._prefix + secrets.token_hex(4)

    def state(self, job_id: str) -> str:
        """The state of one job."""
        with self._database.read() as connection:
            return str(connection.execute(select(jobs.c.state).where(jobs.c.id == job_id)).scalar_one())

    def held_state(self, job_id: str) -> str | None:
        """The state of a job that this service holds; None if another service holds it."""
        with self._database.read() as connection:
            return connection.execute(select(jobs.c.state).where(self._held(job_id))).scalar_one_or_none()

    def load(self) -> tuple[dict[str, int], float | None]:
        """The number of jobs in each state, and the creation time of the oldest queued job."""
        with self._database.read() as connection:
            counts = connection.execute(select(jobs.c.state, func.count()).group_by(jobs.c.state))
            by_state = {state: int(count) for state, count in counts}
            waiting = select(func.min(jobs.c.created)).where(jobs.c.state == "queued")
            return by_state, connection.execute(waiting).scalar_one()

    def lengths(self, tenant: Tenant) -> dict[str, tuple[int, int]]:
        """The numbers of queued and of running jobs: those of a tenant, and of all tenants together."""
        mine = func.sum(case((jobs.c.tenant == tenant, 1), else_=0))
        active = select(jobs.c.state, mine, func.count()).where(jobs.c.state.not_in(ENDED))
        found = {"queued": (0, 0), "running": (0, 0)}
        with self._database.read() as connection:
            for state, own, everyone in connection.execute(active.group_by(jobs.c.state)):
                name = "queued" if state == "queued" else "running"
                before = found[name]
                found[name] = before[0] + int(own), before[1] + int(everyone)
        return found

    def longest(self, most: int) -> dict[tuple[Account, str], int]:
        """Unfinished jobs by account and state, of the accounts that have most."""
        unfinished = select(account_in(jobs.c.tenant).label("account"), jobs.c.state)
        each = unfinished.where(jobs.c.state.not_in(ENDED)).subquery()
        query = select(each.c.account, each.c.state, func.count()).group_by(each.c.account, each.c.state)
        with self._database.read() as connection:
            numbers = {(Account(one), str(state)): int(n) for one, state, n in connection.execute(query)}
        totals: Counter[Account] = Counter()
        for (account, _), number in numbers.items():
            totals[account] += number
        kept = sorted(totals, key=lambda account: (-totals[account], account))[:most]
        return {key: number for key, number in numbers.items() if key[0] in kept}

    def unfinished(self) -> set[str]:
        """The ids of all jobs that have not ended."""
        with self._database.read() as connection:
            return set(connection.execute(select(jobs.c.id).where(jobs.c.state.not_in(ENDED))).scalars())

    def claim(self, *, idle_only: bool = False) -> JobRow | None:
        """Claim the next queued job and return it; None when no job is queued.

        The next account is the one with the fewest running jobs, then the one whose last job started first;
        its oldest job is claimed.

        Args:
            idle_only: only consider accounts without a running job.
        """
        with self._database.write() as connection:
            job_id = _next(connection, idle_only=idle_only)
            if job_id is None:
                return None
            now = time.time()
            # The progress of an earlier attempt stays until the first report: jobs resume from checkpoints.
            begun: Plain = {"attempts": jobs.c.attempts + 1, "started": now}
            lease: Plain = {"lease_owner": self._owner, "lease_until": now + LEASE_S}
            change(connection, job_id, ("queued",), "running", self._owner, **begun, **lease)
            claimed = select(jobs).where(jobs.c.id == job_id)
            return cast(JobRow, dict(connection.execute(claimed).mappings().one()))

    def renew(self, held: Collection[str]) -> None:
        """Renew the leases of running jobs."""
        with self._database.write() as connection:
            mine = jobs.c.id.in_(held), jobs.c.lease_owner == self._owner, jobs.c.state.in_(RUNNING)
            connection.execute(update(jobs).where(*mine).values(lease_until=time.time() + LEASE_S))

    def reset_attempts(self, job_id: str) -> None:
        """Reset the number of attempts of a job that has saved a checkpoint."""
        with self._database.write() as connection:
            connection.execute(update(jobs).where(self._held(job_id), jobs.c.attempts > 1).values(attempts=1))

    def record_size(self, job_id: str, size: int) -> None:
        """Store the disk usage of a running job, if it exceeds the reserved size, bytes."""
        with self._database.write() as connection:
            mine = select(jobs.c.tenant).where(self._held(job_id))
            tenant = connection.execute(mine).scalar_one_or_none()
            if tenant is not None:
                usage.grow(connection, Tenant(tenant), job_id, size)

    def _held(self, job_id: str) -> ColumnElement[bool]:
        return and_(jobs.c.id == job_id, jobs.c.lease_owner == self._owner, jobs.c.state.in_(RUNNING))

    def progress(self, job_id: str, done: int, total: int, history: list[Plain], phase: str = "") -> None:
        """Store the progress of a running job."""
        now: Plain = {"done": done, "total": total, "history": history, "phase": phase}
        with self._database.write() as connection:
            connection.execute(update(jobs).where(self._held(job_id)).values(**now))

    def succeed(self, job_id: str, result: Plain | None, into: str = volumes.name, size: int = 0) -> bool:
        """Store the success and the result of a job.

        Args:
            job_id: of the job.
            result: a row; an existing row with this id is kept.
            into: the name of its table.
            size: bytes of a result without a row.

        Returns:
            False if the job was cancelled in the meantime.
        """
        with self._database.write() as connection:
            now = time.time()
            advice = (result or {}).get("provenance", {}).get("advice")
            if not self._end(connection, job_id, ("running",), "succeeded", finished=now, advice=advice):
                return False
            mine = select(jobs.c.tenant).where(jobs.c.id == job_id)
            tenant = Tenant(connection.execute(mine).scalar_one())
            if result is None:
                usage.store(connection, tenant, job_id, size)
            else:
                table = schema.metadata.tables[into]
                there = select(table.c.id).where(table.c.tenant == tenant, table.c.id == result["id"])
                if connection.execute(there).first() is None:
                    row = {**result, "tenant": tenant, "job_id": job_id, "created": now}
                    connection.execute(insert(table).values(**row))
                    usage.store(connection, tenant, result["id"], result["bytes"])
            return True

    def fail(self, job_id: str, problem: Plain) -> None:
        """End a job with the problem that made it fail."""
        with self._database.write() as connection:
            note, now = str(problem["detail"])[:500], time.time()
            self._end(connection, job_id, RUNNING, "failed", note, finished=now, error=problem)

    def mark_cancelled(self, job_id: str) -> None:
        """End a job after a cancellation."""
        with self._database.write() as connection:
            self._end(connection, job_id, RUNNING, "cancelled", finished=time.time())

    def release(self, job_id: str, note: str) -> None:
        """Put a running job back in the queue for a reason outside of the job."""
        with self._database.write() as connection:
            again: Plain = {"started": None, "attempts": jobs.c.attempts - 1}
            if not self._end(connection, job_id, ("running",), "queued", note, **again):
                self._end(connection, job_id, ("cancelling",), "cancelled", finished=time.time())

    def _end(
        self,
        connection: Connection,
        job_id: str,
        before: tuple[str, ...],
        after: str,
        note: str = "",
        **values: Any,
    ) -> bool:
        """Change the state of a job held by this service and drop the lease; returns whether it was held."""
        held = jobs.c.lease_owner == self._owner
        return change(
            connection, job_id, before, after, note, held, **values, lease_owner=None, lease_until=None
        )

    def recover(self, crashed: Plain, *, held: Collection[str] = ()) -> int:
        """Take over jobs of dead services: running jobs are queued again, cancelling jobs end.

        A job whose service died ``MAX_ATTEMPTS`` times without progress fails with ``crashed``.

        Args:
            crashed: the problem.
            held: the jobs that run in this service; its other jobs were claimed over a broken connection.

        Returns:
            the number of jobs queued again.
        """
        now, again = time.time(), 0
        dead: ColumnElement[bool] = func.coalesce(jobs.c.lease_until, 0.0) < now
        predecessor = jobs.c.lease_owner.startswith(self._prefix, autoescape=True)
        dead = or_(dead, and_(predecessor, jobs.c.lease_owner != self._owner))
        dead = and_(dead, jobs.c.id.not_in(held))
        left = select(jobs).where(jobs.c.state.in_(RUNNING), dead).with_for_update(skip_locked=True)
        free: Plain = {"lease_owner": None, "lease_until": None}
        with self._database.write() as connection:
            for row in connection.execute(left).mappings().all():
                job_id = row["id"]
                if row["state"] == "cancelling":
                    change(connection, job_id, ("cancelling",), "cancelled", finished=now, **free)
                elif row["attempts"] >= MAX_ATTEMPTS:
                    change(connection, job_id, ("running",), "failed", finished=now, error=crashed, **free)
                else:
                    change(
                        connection, job_id, ("running",), "queued", "the service died", started=None, **free
                    )
                    again += 1
        return again


def _next(connection: Connection, *, idle_only: bool) -> str | None:
    """The job to claim, locked; those that another service claims at this moment are skipped."""
    for turn in sorted(turns_of(connection).values()):
        if idle_only and turn.running:
            return None
        mine = select(jobs.c.id).where(jobs.c.tenant.in_(turn.tenants), jobs.c.state == "queued")
        oldest = mine.order_by(jobs.c.number).limit(1).with_for_update(skip_locked=True)
        if job_id := connection.execute(oldest).scalar_one_or_none():
            return str(job_id)
    return None

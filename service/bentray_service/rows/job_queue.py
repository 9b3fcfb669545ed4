"""The job queue of all tenants, used by the job runner of the service."""

import secrets
import time
from collections import Counter
from collections.abc import Callable, Collection
from typing import Any

from sqlalchemy import ColumnElement, and_, case, func, or_, select, update
from sqlalchemy.orm import Session

from . import usage
from .accounts import Account, account_in
from .database import Database, Repository
from .ids import Tenant
from .job_states import RUNNING, change, turns_of
from .tables import ENDED, JobRow, Plain, ResultRow, ResultVolumeRow

MAX_ATTEMPTS = 3
# Queued jobs of an account among which a short one is looked for.
MAX_COMPARED = 50

# Time after which a service that does not renew its lease is considered dead, s.
LEASE_S = 30.0

# Key in the provenance of a result, and then in the plan of its job: what made the image, in words.
MADE_BY = "made_by"


class Queue(Repository):
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
        super().__init__(database)
        self._prefix = f"{installation or secrets.token_hex(8)}-"
        self._owner = self._prefix + secrets.token_hex(4)

    def state(self, job_id: str) -> str:
        """The state of one job."""
        with self._database.read() as session:
            return session.scalars(select(JobRow.state).where(JobRow.id == job_id)).one()

    def held_state(self, job_id: str) -> str | None:
        """The state of a job that this service holds; None if another service holds it."""
        return self._database.row(select(JobRow.state).where(self._held(job_id)))

    def load(self) -> tuple[dict[str, int], float | None]:
        """The number of jobs in each state, and the creation time of the oldest queued job."""
        with self._database.read() as session:
            counts = session.execute(select(JobRow.state, func.count()).group_by(JobRow.state))
            waiting = select(func.min(JobRow.created)).where(JobRow.state == "queued")
            return {state: number for state, number in counts}, session.scalar(waiting)  # noqa: C416 - rows

    def lengths(self, tenant: Tenant) -> dict[str, tuple[int, int]]:
        """The numbers of queued and of running jobs: those of a tenant, and of all tenants together."""
        mine = func.sum(case((JobRow.tenant == tenant, 1), else_=0))
        active = select(JobRow.state, mine, func.count()).where(JobRow.state.not_in(ENDED))
        found = {"queued": (0, 0), "running": (0, 0)}
        with self._database.read() as session:
            for state, own, everyone in session.execute(active.group_by(JobRow.state)):
                name = "queued" if state == "queued" else "running"
                before = found[name]
                found[name] = before[0] + int(own), before[1] + int(everyone)
        return found

    def longest(self, most: int) -> dict[tuple[Account, str], int]:
        """Unfinished jobs by account and state, of the accounts that have most."""
        unfinished = select(account_in(JobRow.tenant).label("account"), JobRow.state)
        each = unfinished.where(JobRow.state.not_in(ENDED)).subquery()
        query = select(each.c.account, each.c.state, func.count()).group_by(each.c.account, each.c.state)
        with self._database.read() as session:
            numbers = {(Account(name), state): count for name, state, count in session.execute(query)}
        totals: Counter[Account] = Counter()
        for (account, _), number in numbers.items():
            totals[account] += number
        kept = sorted(totals, key=lambda account: (-totals[account], account))[:most]
        return {key: number for key, number in numbers.items() if key[0] in kept}

    def unfinished(self) -> set[str]:
        """The ids of all jobs that have not ended."""
        return set(self._database.rows(select(JobRow.id).where(JobRow.state.not_in(ENDED))))

    def claim(
        self, *, idle_only: bool = False, accepts: Callable[[Plain], bool] | None = None
    ) -> JobRow | None:
        """Claim the next queued job and return it; None when no job is queued.

        The next account is the one with the fewest running jobs, then the one whose last job started first;
        its oldest job is claimed.

        Args:
            idle_only: only consider accounts without a running job.
            accepts: called with the plans of the oldest jobs of an account, of which the first accepted one
                is claimed; None: the oldest one.
        """
        with self._database.write() as session:
            job_id = _next(session, idle_only=idle_only, accepts=accepts)
            if job_id is None:
                return None
            now = time.time()
            # The progress of an earlier attempt stays until the first report: jobs resume from checkpoints.
            begun: Plain = {"attempts": JobRow.attempts + 1, "started": now}
            lease: Plain = {"lease_owner": self._owner, "lease_until": now + LEASE_S}
            change(session, job_id, ("queued",), "running", self._owner, **begun, **lease)
            return session.scalars(select(JobRow).where(JobRow.id == job_id)).one()

    def renew(self, held: Collection[str]) -> None:
        """Renew the leases of running jobs."""
        mine = JobRow.id.in_(held), JobRow.lease_owner == self._owner, JobRow.state.in_(RUNNING)
        self._database.change(update(JobRow).where(*mine).values(lease_until=time.time() + LEASE_S))

    def reset_attempts(self, job_id: str) -> None:
        """Reset the number of attempts of a job that has saved a checkpoint."""
        mine = self._held(job_id), JobRow.attempts > 1
        self._database.change(update(JobRow).where(*mine).values(attempts=1))

    def record_size(self, job_id: str, size: int) -> None:
        """Store the disk usage of a running job, if it exceeds the reserved size, bytes."""
        with self._database.write() as session:
            tenant = session.scalar(select(JobRow.tenant).where(self._held(job_id)))
            if tenant is not None:
                usage.grow(session, tenant, job_id, size)

    def _held(self, job_id: str) -> ColumnElement[bool]:
        return and_(JobRow.id == job_id, JobRow.lease_owner == self._owner, JobRow.state.in_(RUNNING))

    def progress(self, job_id: str, done: int, total: int, history: list[Plain], phase: str = "") -> None:
        """Store the progress of a running job."""
        now: Plain = {"done": done, "total": total, "history": history, "phase": phase}
        self._database.change(update(JobRow).where(self._held(job_id)).values(**now))

    def succeed(
        self, job_id: str, result: Plain | None, into: type[ResultRow] = ResultVolumeRow, size: int = 0
    ) -> bool:
        """Store the success and the result of a job.

        Args:
            job_id: of the job.
            result: columns of a row; an existing row with this id is kept.
            into: its table.
            size: bytes of a result without a row.

        Returns:
            False if the job was cancelled in the meantime.
        """
        with self._database.write() as session:
            now = time.time()
            said = (result or {}).get("provenance", {})
            ended = {"finished": now, "advice": said.get("advice")}
            if not self._end(session, job_id, ("running",), "succeeded", **ended):
                return False
            tenant, plan = session.execute(select(JobRow.tenant, JobRow.plan).filter_by(id=job_id)).one()
            if plan and MADE_BY in said:
                plan = {**plan, MADE_BY: said[MADE_BY]}
                session.execute(update(JobRow).filter_by(id=job_id).values(plan=plan))
            if result is None:
                usage.store(session, tenant, job_id, size)
            else:
                if session.scalar(select(into.id).filter_by(tenant=tenant, id=result["id"])) is None:
                    session.add(into(**result, tenant=tenant, job_id=job_id, created=now))
                    usage.store(session, tenant, result["id"], result["bytes"])
            return True

    def fail(self, job_id: str, problem: Plain) -> None:
        """End a job with the problem that made it fail."""
        with self._database.write() as session:
            note, now = str(problem["detail"])[:500], time.time()
            self._end(session, job_id, RUNNING, "failed", note, finished=now, error=problem)

    def mark_cancelled(self, job_id: str) -> None:
        """End a job after a cancellation."""
        with self._database.write() as session:
            self._end(session, job_id, RUNNING, "cancelled", finished=time.time())

    def release(self, job_id: str, note: str) -> None:
        """Put a running job back in the queue for a reason outside of the job."""
        with self._database.write() as session:
            again: Plain = {"started": None, "attempts": JobRow.attempts - 1}
            if not self._end(session, job_id, ("running",), "queued", note, **again):
                self._end(session, job_id, ("cancelling",), "cancelled", finished=time.time())

    def _end(
        self,
        session: Session,
        job_id: str,
        before: tuple[str, ...],
        after: str,
        note: str = "",
        **values: Any,
    ) -> bool:
        """Change the state of a job held by this service and drop the lease; returns whether it was held."""
        held = JobRow.lease_owner == self._owner
        return change(
            session, job_id, before, after, note, held, **values, lease_owner=None, lease_until=None
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
        dead: ColumnElement[bool] = func.coalesce(JobRow.lease_until, 0.0) < now
        predecessor = JobRow.lease_owner.startswith(self._prefix, autoescape=True)
        dead = or_(dead, and_(predecessor, JobRow.lease_owner != self._owner))
        dead = and_(dead, JobRow.id.not_in(held))
        left = select(JobRow).where(JobRow.state.in_(RUNNING), dead).with_for_update(skip_locked=True)
        free: Plain = {"lease_owner": None, "lease_until": None}
        with self._database.write() as session:
            for row in session.scalars(left).all():
                job_id = row.id
                if row.state == "cancelling":
                    change(session, job_id, ("cancelling",), "cancelled", finished=now, **free)
                elif row.attempts >= MAX_ATTEMPTS:
                    change(session, job_id, ("running",), "failed", finished=now, error=crashed, **free)
                else:
                    change(session, job_id, ("running",), "queued", "the service died", started=None, **free)
                    again += 1
        return again


def _next(session: Session, *, idle_only: bool, accepts: Callable[[Plain], bool] | None) -> str | None:
    """The job to claim, locked; those that another service claims at this moment are skipped."""
    for turn in sorted(turns_of(session).values()):
        if idle_only and turn.running:
            return None
        mine = select(JobRow.id, JobRow.plan).where(JobRow.tenant.in_(turn.tenants), JobRow.state == "queued")
        limit = 1 if accepts is None else MAX_COMPARED
        oldest = mine.order_by(JobRow.number).limit(limit).with_for_update(skip_locked=True)
        for job_id, plan in session.execute(oldest):
            if accepts is None or accepts(plan or {}):
                return str(job_id)
    return None

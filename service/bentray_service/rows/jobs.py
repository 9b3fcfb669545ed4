"""The table of jobs for their tenants: submit, list, watch, cancel."""

import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from typing import NamedTuple

from sqlalchemy import func, select
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from ..errors import JobFinished, QueueFull, UnknownId
from . import usage
from .accounts import account_of, family_of
from .ids import Tenant, checked, new_id
from .job_states import append_event, change, turns_of
from .stored_tables import NamedTable, RequestKey, matches
from .tables import ENDED, UNFINISHED, EventRow, JobRow, Plain

BATCH = 500


@dataclass(frozen=True)
class NewJob:
    """A job to insert.

    Attributes:
        kind: a key of ``jobs.kinds.KINDS``.
        settings: of the job, as JSON.
        dataset_id, volume_id, mesh_id: inputs.
        field_id: output, if its id is known in advance.
        plan: decomposition into tasks.
        reserved: maximum bytes that it stores while it runs.
    """

    kind: str
    settings: Plain
    dataset_id: str | None = None
    volume_id: str | None = None
    mesh_id: str | None = None
    field_id: str | None = None
    plan: Plain | None = None
    reserved: int = 0


@dataclass(frozen=True)
class Submission:
    """Properties common to all jobs of a request.

    Attributes:
        most_bytes: quota of the tenant; None: nothing is reserved.
        most_queued: maximum number of queued jobs.
        key: idempotency key.
        started_by: id of the key, or the user.
        webhook: address to call when each job ends.
    """

    most_bytes: int | None = None
    most_queued: int | None = None
    key: str | None = None
    started_by: str = ""
    webhook: str | None = None


NO_LIMITS = Submission()


class JobProgress(NamedTuple):
    """How far a job is."""

    id: str
    state: str
    done: int
    total: int
    phase: str | None


PROGRESS = JobRow.id, JobRow.state, JobRow.done, JobRow.total, JobRow.phase


class Jobs(NamedTable[JobRow]):
    """Jobs of a tenant; :class:`bentray_service.rows.job_queue.Queue` runs them."""

    table, what = JobRow, "job"

    def add(self, tenant: Tenant, new: NewJob, how: Submission = NO_LIMITS) -> JobRow:
        """Insert a queued job; it survives a crash once this method returns.

        A key that this tenant has used before returns the job of that request.

        Args:
            tenant: owner.
            new: the job.
            how: limits, key and user of the request.

        Raises:
            KeyReused: when the key was used with another request.
            QuotaExceeded: when less than the reserved size is available.
            QueueFull: when too many jobs of this tenant are queued.
            UnknownId: when the dataset has been deleted in the meantime.
        """
        called = [] if how.webhook is None else [how.webhook]
        content = [new.kind, new.settings, new.dataset_id, new.volume_id, new.mesh_id, *called]
        request = RequestKey.from_header(how.key, content)
        with self._database.write() as session:
            before = request.earlier(session, JobRow, tenant)
            if before is not None:
                return before
            job_id = insert_jobs(session, tenant, [new], how, request=request)[0]
        return self.get(tenant, job_id)

    def search(
        self,
        tenant: Tenant,
        limit: int,
        before: str | None = None,
        text: str | None = None,
        **equal: str | None,
    ) -> list[JobRow]:
        """Newest jobs with a text and values of columns.

        Args:
            tenant, limit, before: as of ``newest``.
            text: only jobs that ``matches``.
            equal: only jobs with these values, None for any: ``state``, ``kind`` or ``batch_id``.
        """
        only = [getattr(JobRow, name) == value for name, value in equal.items() if value is not None]
        if text:
            only.append(matches(tenant, text))
        return self.newest(tenant, limit, *only, before=before)

    def place(self, job: JobRow) -> int | None:
        """How many queued jobs of all tenants start before this one if jobs run one at a time.

        The order is that of ``Queue.claim``; None of a job that is not queued.
        """
        if job.state != "queued":
            return None
        return self.queue_position(job.tenant, job.number)

    def queue_position(self, tenant: Tenant, number: int | None = None) -> int:
        """The place of a queued job of a tenant by its number; None: of one that it would submit now."""
        with self._database.read() as session:
            account = account_of(session, tenant)
            turns = turns_of(session, account)
            own = turns.pop(account)
            older = [JobRow.tenant.in_(own.tenants), JobRow.state == "queued"]
            if number is not None:
                older.append(JobRow.number < number)
            mine = session.scalars(select(func.count()).where(*older)).one()
        # Accounts take turns: one that goes first starts a job more before this one.
        return mine + sum(min(turn.queued, mine + (turn < own)) for turn in turns.values())

    def durations(self, tenant: Tenant, kind: str, limit: int) -> list[tuple[Plain, float]]:
        """Plan and running time, s, of up to ``limit`` successful jobs of this tenant, the newest first."""
        query = (
            select(JobRow.plan, JobRow.finished - JobRow.started)
            .where(JobRow.tenant == tenant, JobRow.kind == kind, JobRow.state == "succeeded")
            .where(JobRow.started.is_not(None), JobRow.finished.is_not(None))
            .order_by(JobRow.number.desc())
            .limit(limit)
        )
        with self._database.read() as session:
            return [(plan or {}, took or 0.0) for plan, took in session.execute(query)]

    def updates(self, known: Mapping[str, int]) -> tuple[dict[str, JobProgress], dict[str, list[EventRow]]]:
        """The progress of jobs, and their new events, of all tenants.

        Args:
            known: for each job id, the number of its last known event, or 0.

        Returns:
            progress by job id; new events by job id, oldest first.
        """
        progress: dict[str, JobProgress] = {}
        events: dict[str, list[EventRow]] = {}
        # Jobs before events: an event in between is returned next time, and none is lost at the end.
        for ids in _batches(list(known)):
            with self._database.read() as session:
                rows = session.execute(select(*PROGRESS).where(JobRow.id.in_(ids)))
                progress.update({row.id: JobProgress(*row) for row in rows})
                last = (
                    select(EventRow.job_id, func.max(EventRow.number))
                    .where(EventRow.job_id.in_(ids))
                    .group_by(EventRow.job_id)
                )
                newer = [job for job, number in session.execute(last) if number > known[job]]
                if not newer:
                    continue
                least = min(known[job] for job in newer)
                query = select(EventRow).where(EventRow.job_id.in_(newer), EventRow.number > least)
                for event in session.scalars(query.order_by(EventRow.number)):
                    if event.number > known[event.job_id]:
                        events.setdefault(event.job_id, []).append(event)
        return progress, events

    def changes(
        self, tenant: Tenant, newest: int | None, unfinished: Collection[str]
    ) -> tuple[int, list[JobProgress]]:
        """The progress of the unfinished jobs of this tenant, and of those that may have ended since.

        Args:
            tenant: owner.
            newest: number of the newest job at the last call; None at the first.
            unfinished: ids of the jobs that were unfinished at the last call.

        Returns:
            the number of the newest job; the jobs, oldest first.
        """
        mine = select(JobRow.number, *PROGRESS).where(JobRow.tenant == tenant)
        with self._database.read() as session:
            last = session.scalar(select(func.max(JobRow.number)).where(JobRow.tenant == tenant)) or 0
            rows = {row.id: row for row in session.execute(mine.where(JobRow.state.in_(UNFINISHED)))}
            if newest is not None and newest < last:
                # A job may begin and end between two calls.
                rows |= {row.id: row for row in session.execute(mine.where(JobRow.number > newest))}
            for ids in _batches([job for job in unfinished if job not in rows]):
                rows |= {row.id: row for row in session.execute(mine.where(JobRow.id.in_(ids)))}
        return last, [JobProgress(*row[1:]) for row in sorted(rows.values(), key=lambda row: row.number)]

    def request_cancel(self, tenant: Tenant, job_id: str) -> JobRow:
        """Cancel a job: a queued one ends at once, a running one after its next poll.

        Raises:
            UnknownId: when this tenant has no such job.
            JobFinished: when it has ended.
        """
        with self._database.write() as session:
            query = select(JobRow.state).filter_by(tenant=tenant, id=checked("job", job_id))
            state = session.scalar(query.with_for_update())
            if state is None:
                raise UnknownId("job", job_id)
            if state in ENDED:
                raise JobFinished("state", state, "queued or running; the job has ended")
            change(session, job_id, ("queued",), "cancelled", finished=time.time())
            change(session, job_id, ("running",), "cancelling")
        return self.get(tenant, job_id)


def insert_jobs(
    session: Session,
    tenant: Tenant,
    new: Sequence[NewJob],
    how: Submission,
    batch_id: str | None = None,
    request: RequestKey | None = None,
) -> list[str]:
    """Insert queued jobs; returns their ids.

    Args:
        session: in a write transaction.
        tenant: owner.
        new: the jobs.
        how: limits and user.
        batch_id: of the batch that they belong to.
        request: its idempotency key, if it is for one job.

    Raises:
        QuotaExceeded, QueueFull, UnknownId: as for ``Jobs.add``; the transaction must be rolled back.
    """
    if how.most_queued is not None:
        family = family_of(session, tenant)
        mine = select(func.count()).where(JobRow.tenant.in_(family), JobRow.state == "queued")
        waiting = session.scalars(mine).one()
        if waiting + len(new) > how.most_queued:
            more = f" and {len(new)} more" if len(new) > 1 else ""
            accepted = f"fewer than {how.most_queued} queued; try again later"
            raise QueueFull("jobs", f"{waiting} queued{more}", accepted)
    ids = []
    for job in new:
        job_id = new_id("job")
        if how.most_bytes is not None:
            usage.reserve(session, tenant, job_id, job.reserved, how.most_bytes)
        columns = asdict(job)
        del columns["reserved"]
        columns |= {"state": "queued", "created": time.time(), "webhook": how.webhook}
        columns |= {} if request is None else request.columns()
        row = JobRow(id=job_id, tenant=tenant, batch_id=batch_id, started_by=how.started_by[:200], **columns)
        with _dataset_exists(job.dataset_id):
            session.add(row)
            session.flush()
        append_event(session, job_id, "queued")
        ids.append(job_id)
    return ids


def _batches(ids: list[str]) -> Iterator[list[str]]:
    """Batches small enough for one query of any database."""
    for begin in range(0, len(ids), BATCH):
        yield ids[begin : begin + BATCH]


@contextmanager
def _dataset_exists(dataset_id: str | None) -> Iterator[None]:
    """Report a dataset that was deleted after the validation of the request as unknown."""
    try:
        yield
    except IntegrityError:
        if dataset_id is None:
            raise
        raise UnknownId("dataset", dataset_id) from None

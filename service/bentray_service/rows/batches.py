"""The table of batches: reconstructions of many scans that were started, are watched and cancelled as one."""

import time
from collections.abc import Sequence

from sqlalchemy import select
from sqlalchemy.orm import selectinload

from ..errors import JobFinished, UnknownId
from .database import Repository
from .ids import Tenant, checked, new_id
from .job_states import change
from .jobs import NewJob, Submission, insert_jobs
from .stored_tables import RequestKey
from .tables import UNFINISHED, BatchRow, JobRow, Plain


class Batches(Repository):
    """Batches of a tenant. Their jobs are ordinary jobs, so that a batch survives whatever they survive."""

    def add(
        self, tenant: Tenant, name: str, settings: Plain, new: Sequence[NewJob], how: Submission
    ) -> BatchRow:
        """Insert a batch with its queued jobs; all survive a crash once this method returns, or none.

        Args:
            tenant: owner.
            name: given by the user; may be empty.
            settings: of all jobs, as JSON.
            new: the jobs.
            how: limits, key and user of the request.

        Raises:
            KeyReused, QuotaExceeded, QueueFull, UnknownId: as for ``Jobs.add``.
        """
        called = [] if how.webhook is None else [how.webhook]
        request = RequestKey.from_header(how.key, [name, settings, [one.dataset_id for one in new], *called])
        with self._database.write() as session:
            before = request.earlier(session, BatchRow, tenant)
            if before is None:
                batch_id = new_id("batch")
                row = {"id": batch_id, "tenant": tenant, "name": name, "settings": settings, "size": len(new)}
                made = {"created": time.time(), "started_by": how.started_by[:200], **request.columns()}
                session.add(BatchRow(**row, **made))
                insert_jobs(session, tenant, new, how, batch_id)
            else:
                batch_id = before.id
        batch = self.get(tenant, batch_id)
        batch.replayed = before is not None
        return batch

    def get(self, tenant: Tenant, name: str) -> BatchRow:
        """One batch of this tenant with the state of its jobs.

        Raises:
            UnknownId: when the tenant has no such batch.
        """
        found = self.newest(tenant, 1, checked("batch", name))
        if not found:
            raise UnknownId("batch", name)
        return found[0]

    def newest(self, tenant: Tenant, limit: int, name: str | None = None) -> list[BatchRow]:
        """Up to ``limit`` batches of this tenant, newest first; only the one with an id."""
        query = select(BatchRow).where(BatchRow.tenant == tenant)
        if name is not None:
            query = query.where(BatchRow.id == name)
        columns = JobRow.id, JobRow.dataset_id, JobRow.state, JobRow.done, JobRow.total, JobRow.phase
        read = selectinload(BatchRow.jobs).load_only(*columns, JobRow.started, JobRow.finished)
        return self._database.rows(query.options(read).order_by(BatchRow.number.desc()).limit(limit))

    def request_cancel(self, tenant: Tenant, name: str) -> BatchRow:
        """Cancel all jobs that have not ended.

        Raises:
            UnknownId: when the tenant has no such batch.
            JobFinished: when all have ended.
        """
        batch = self.get(tenant, name)
        with self._database.write() as session:
            left = JobRow.batch_id == batch.id, JobRow.state.in_(UNFINISHED)
            ids = list(session.scalars(select(JobRow.id).where(*left).order_by(JobRow.number)))
            if not ids:
                raise JobFinished("state", batch.state, "queued or running; all jobs have ended")
            for job_id in ids:
                change(session, job_id, ("queued",), "cancelled", finished=time.time())
                change(session, job_id, ("running",), "cancelling")
        return self.get(tenant, name)

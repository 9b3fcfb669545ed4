"""The table of batches: reconstructions of many scans that were started, are watched and cancelled as one."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from typing import cast

from sqlalchemy import Connection, insert, select

from ..errors import JobFinished, UnknownId
from .database import Database
from .idempotency import RequestKey
from .ids import checked, new_id
from .job_states import change
from .jobs import NewJob, Submission, insert_jobs
from .schema import ENDED, UNFINISHED, batches, jobs
from .tenants import Tenant
from .typed_rows import BatchJob, BatchRow, Plain

# The phase of a reconstruction that counts as progress; the others are short and count by themselves.
COUNTED = (None, "", "reconstructing")
# Jobs of a batch that are read in one query.
IDS = 500


class Batches:
    """Batches of a tenant. Their jobs are ordinary jobs, so that a batch survives whatever they survive."""

    def __init__(self, database: Database) -> None:
        self._database = database

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
        with self._database.write() as connection:
            before = request.earlier(connection, batches, tenant)
            if before is None:
                batch_id = new_id("batch")
                row: Plain = {"id": batch_id, "tenant": tenant, "name": name, "settings": settings}
                row |= {"size": len(new), "created": time.time(), "started_by": how.started_by[:200]}
                row |= request.columns()
                connection.execute(insert(batches).values(**row))
                insert_jobs(connection, tenant, new, how, batch_id)
            else:
                batch_id = before["id"]
        return self.get(tenant, batch_id)

    def get(self, tenant: Tenant, name: str) -> BatchRow:
        """One batch of this tenant with the state of its jobs.

        Raises:
            UnknownId: when the tenant has no such batch.
        """
        found = self._read(tenant, 1, checked("batch", name))
        if not found:
            raise UnknownId("batch", name)
        return found[0]

    def newest(self, tenant: Tenant, limit: int) -> list[BatchRow]:
        """Up to ``limit`` batches of this tenant, newest first."""
        return self._read(tenant, limit)

    def request_cancel(self, tenant: Tenant, name: str) -> BatchRow:
        """Cancel all jobs that have not ended.

        Raises:
            UnknownId: when the tenant has no such batch.
            JobFinished: when all have ended.
        """
        batch = self.get(tenant, name)
        with self._database.write() as connection:
            left = jobs.c.batch_id == batch["id"], jobs.c.state.in_(UNFINISHED)
            ids = list(connection.execute(select(jobs.c.id).where(*left).order_by(jobs.c.number)).scalars())
            if not ids:
                raise JobFinished("state", batch["state"], "queued or running; all jobs have ended")
            for job_id in ids:
                change(connection, job_id, ("queued",), "cancelled", finished=time.time())
                change(connection, job_id, ("running",), "cancelling")
        return self.get(tenant, name)

    def _read(self, tenant: Tenant, limit: int, name: str | None = None) -> list[BatchRow]:
        query = select(batches).where(batches.c.tenant == tenant)
        if name is not None:
            query = query.where(batches.c.id == name)
        with self._database.read() as connection:
            rows = connection.execute(query.order_by(batches.c.number.desc()).limit(limit)).mappings()
            found = {row["id"]: dict(row) for row in rows}
            children = _children(connection, list(found))
        return [cast(BatchRow, {**row, **_state(children.get(one, []))}) for one, row in found.items()]


def _children(connection: Connection, ids: list[str]) -> dict[str, list[BatchJob]]:
    """The jobs of batches, oldest first."""
    columns = (
        *(jobs.c.batch_id, jobs.c.id, jobs.c.dataset_id, jobs.c.state, jobs.c.done, jobs.c.total),
        *(jobs.c.phase, jobs.c.started, jobs.c.finished),
    )
    found: dict[str, list[BatchJob]] = {}
    for begin in range(0, len(ids), IDS):
        mine = jobs.c.batch_id.in_(ids[begin : begin + IDS])
        for row in connection.execute(select(*columns).where(mine).order_by(jobs.c.number)).mappings():
            found.setdefault(row["batch_id"], []).append(cast(BatchJob, dict(row)))
    return found


def _state(children: Sequence[BatchJob]) -> Plain:
    """State, progress, times and jobs of a batch, from its jobs."""
    counts = Counter(child["state"] for child in children)
    ended = all(child["state"] in ENDED for child in children)
    return {
        "state": _word(counts, ended=ended),
        "fraction": sum(map(_fraction, children)) / len(children) if children else 1.0,
        "counts": dict(counts),
        "jobs": list(children),
        "started": min((child["started"] for child in children if child["started"]), default=None),
        "finished": max((child["finished"] or 0.0 for child in children), default=None) if ended else None,
    }


def _word(counts: Counter[str], *, ended: bool) -> str:
    if ended:
        return next((state for state in ("failed", "cancelled") if counts[state]), "succeeded")
    if counts["cancelling"] and not counts["running"] and not counts["queued"]:
        return "cancelling"
    # Between two of its jobs it does not wait.
    return "queued" if set(counts) == {"queued"} else "running"


def _fraction(child: BatchJob) -> float:
    """How far a job is, 0 to 1; what has ended counts as done, whatever its end."""
    if child["state"] in ENDED:
        return 1.0
    if child["state"] == "queued" or not child["total"] or child["phase"] not in COUNTED:
        return 0.0
    return min(1.0, child["done"] / child["total"])

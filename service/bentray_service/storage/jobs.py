"""The rows of jobs: every change of state is one transaction, with one appended event."""

from __future__ import annotations

import time
from typing import Any

from sqlalchemy import Connection, insert, select, update

from ..refusals import Finished, UnknownId
from . import schema
from .database import Database
from .ids import checked, new_id
from .schema import ENDED, jobs, volumes

Row = dict[str, Any]
MAX_ATTEMPTS = 3


class Jobs:
    """Jobs from ``queued`` through ``running`` (and ``cancelling``) to their end."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def add(
        self, kind: str, settings: Row, dataset_id: str | None = None, volume_id: str | None = None
    ) -> Row:
        """Store a queued job on a dataset or a volume; it survives a crash from the moment this returns."""
        job_id = new_id("job")
        with self._database.write() as connection:
            connection.execute(
                insert(jobs).values(
                    id=job_id,
                    kind=kind,
                    dataset_id=dataset_id,
                    volume_id=volume_id,
                    settings=settings,
                    state="queued",
                    created=time.time(),
                )
            )
            _event(connection, job_id, "queued")
        return self.get(job_id)

    def get(self, job_id: str) -> Row:
        """One job.

        Raises:
            UnknownId: when there is none.
        """
        with self._database.read() as connection:
            row = (
                connection.execute(select(jobs).where(jobs.c.id == checked("job", job_id)))
                .mappings()
                .one_or_none()
            )
        if row is None:
            raise UnknownId("job", job_id)
        return dict(row)

    def newest(self, limit: int) -> list[Row]:
        """Up to ``limit`` jobs, newest first."""
        with self._database.read() as connection:
            found = connection.execute(select(jobs).order_by(jobs.c.number.desc()).limit(limit))
            return [dict(row) for row in found.mappings()]

    def state(self, job_id: str) -> str:
        """The state of one job; cheap, for a runner that asks often."""
        with self._database.read() as connection:
            return str(connection.execute(select(jobs.c.state).where(jobs.c.id == job_id)).scalar_one())

    def events(self, job_id: str) -> list[Row]:
        """The appended events of one job, oldest first."""
        table = schema.events
        with self._database.read() as connection:
            found = connection.execute(select(table).where(table.c.job_id == job_id).order_by(table.c.number))
            return [dict(row) for row in found.mappings()]

    def claim(self) -> Row | None:
        """Turn the oldest queued job into a running one and return it; None when none waits."""
        oldest = (
            select(jobs.c.id)
            .where(jobs.c.state == "queued")
            .order_by(jobs.c.number)
            .limit(1)
            .with_for_update(skip_locked=True)
        )
        with self._database.write() as connection:
            job_id = connection.execute(oldest).scalar_one_or_none()
            if job_id is None:
                return None
            attempts, now = jobs.c.attempts + 1, time.time()
            fresh: Row = {"done": 0, "total": 0, "history": []}
            _change(connection, job_id, ("queued",), "running", attempts=attempts, started=now, **fresh)
        return self.get(job_id)

    def progress(self, job_id: str, done: int, total: int, history: list[Row]) -> None:
        """Store how far a running job is."""
        with self._database.write() as connection:
            connection.execute(
                update(jobs).where(jobs.c.id == job_id).values(done=done, total=total, history=history)
            )

    def succeed(self, job_id: str, volume: Row | None) -> bool:
        """Store the success and the volume, if there is one; False when it was cancelled in the meantime."""
        with self._database.write() as connection:
            now = time.time()
            if not _change(connection, job_id, ("running",), "succeeded", finished=now):
                return False
            if volume is not None:
                connection.execute(insert(volumes).values(job_id=job_id, created=now, **volume))
            return True

    def fail(self, job_id: str, problem: Row) -> None:
        """End a job with the problem that stopped it."""
        with self._database.write() as connection:
            note = str(problem["detail"])[:500]
            _change(
                connection,
                job_id,
                ("running", "cancelling"),
                "failed",
                note,
                finished=time.time(),
                error=problem,
            )

    def cancelled(self, job_id: str) -> None:
        """End a job that has stopped as it was asked to."""
        with self._database.write() as connection:
            _change(connection, job_id, ("running", "cancelling"), "cancelled", finished=time.time())

    def release(self, job_id: str) -> None:
        """Put a running job back in the queue because the service stops; it is no fault of the job."""
        with self._database.write() as connection:
            attempts = jobs.c.attempts - 1
            note = "the service was stopped"
            if not _change(connection, job_id, ("running",), "queued", note, started=None, attempts=attempts):
                _change(connection, job_id, ("cancelling",), "cancelled", finished=time.time())

    def request_cancel(self, job_id: str) -> Row:
        """Ask a job to stop: a queued one ends at once, a running one when it next looks.

        Raises:
            UnknownId: when there is no such job.
            Finished: when it has ended already.
        """
        with self._database.write() as connection:
            query = select(jobs.c.state).where(jobs.c.id == checked("job", job_id)).with_for_update()
            state = connection.execute(query).scalar_one_or_none()
            if state is None:
                raise UnknownId("job", job_id)
            if state in ENDED:
                raise Finished("state", state, "queued or running; the job has ended")
            _change(connection, job_id, ("queued",), "cancelled", finished=time.time())
            _change(connection, job_id, ("running",), "cancelling")
        return self.get(job_id)

    def recover(self, crashed: Row) -> int:
        """Take up what a dead process left: running jobs go back to the queue, cancelling ones end.

        A job that saw the service die ``MAX_ATTEMPTS`` times is failed with the problem ``crashed``.
        Returns how many wait again.
        """
        again = 0
        with self._database.write() as connection:
            left = (
                connection.execute(select(jobs).where(jobs.c.state.in_(("running", "cancelling"))))
                .mappings()
                .all()
            )
            for row in left:
                if row["state"] == "cancelling":
                    _change(connection, row["id"], ("cancelling",), "cancelled", finished=time.time())
                elif row["attempts"] >= MAX_ATTEMPTS:
                    _change(
                        connection, row["id"], ("running",), "failed", finished=time.time(), error=crashed
                    )
                else:
                    _change(connection, row["id"], ("running",), "queued", "the service died", started=None)
                    again += 1
        return again


def _change(
    connection: Connection, job_id: str, before: tuple[str, ...], after: str, note: str = "", **values: Any
) -> bool:
    """Change the state if it is one of ``before``; whether it was."""
    changed = connection.execute(
        update(jobs).where(jobs.c.id == job_id, jobs.c.state.in_(before)).values(state=after, **values)
    )
    if changed.rowcount:
        _event(connection, job_id, after, note)
    return bool(changed.rowcount)


def _event(connection: Connection, job_id: str, state: str, note: str = "") -> None:
    connection.execute(insert(schema.events).values(job_id=job_id, time=time.time(), state=state, note=note))

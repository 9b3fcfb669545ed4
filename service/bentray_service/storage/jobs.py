"""The rows of jobs: every change of state is one transaction, with one appended event."""

from __future__ import annotations

import hashlib
import json
import os
import secrets
import socket
import time
from typing import Any

from sqlalchemy import ColumnElement, Connection, and_, func, insert, select, update

from ..refusals import Finished, KeyReused, QueueFull, UnknownId
from . import schema
from .database import Database
from .ids import checked, new_id
from .schema import ENDED, jobs, volumes

Row = dict[str, Any]
MAX_ATTEMPTS = 3

# How long a service that says nothing is believed to be at work on its jobs, s.
LEASE_S = 30.0

TENANT = "local"
RUNNING = ("running", "cancelling")


class Jobs:
    """Jobs from ``queued`` through ``running`` (and ``cancelling``) to their end.

    Who claims a job has a lease of it, renewed as long as the service lives. A service that lost its lease,
    because it stood still for too long, changes nothing of the job any more.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        self._owner = f"{socket.gethostname()[:40]}-{os.getpid()}-{secrets.token_hex(4)}"

    def add(
        self,
        kind: str,
        settings: Row,
        dataset_id: str | None = None,
        volume_id: str | None = None,
        mesh_id: str | None = None,
        field_id: str | None = None,
        *,
        plan: Row | None = None,
        tenant: str = TENANT,
        most_queued: int | None = None,
        key: str | None = None,
    ) -> Row:
        """Store a queued job on its dataset, volume or mesh; it survives a crash once this returns.

        With a ``key`` that this tenant has used before, the job of that time is returned, and none is made.

        Raises:
            KeyReused: when something else was asked under this key.
            QueueFull: when ``most_queued`` jobs of this tenant wait already.
        """
        job_id = new_id("job")
        asked = json.dumps([kind, settings, dataset_id, volume_id, mesh_id], sort_keys=True)
        digest = hashlib.sha256(asked.encode()).hexdigest()
        with self._database.write() as connection:
            if key is not None and connection.dialect.name != "sqlite":
                # SQLite's writers wait for each other from the start; elsewhere this makes them.
                lock = int.from_bytes(hashlib.sha256(f"{tenant}/{key}".encode()).digest()[:8], signed=True)
                connection.execute(select(func.pg_advisory_xact_lock(lock)))
            before = _of_key(connection, tenant, key) if key is not None else None
            if before is not None:
                if before["request_sha256"] != digest:
                    accepted = "a key of its own for every request; this one came with another before"
                    raise KeyReused("Idempotency-Key", repr(key), accepted)
                return before
            if most_queued is not None:
                mine = select(func.count()).where(jobs.c.tenant == tenant, jobs.c.state == "queued")
                waiting = connection.execute(mine).scalar_one()
                if waiting >= most_queued:
                    raise QueueFull(
                        "jobs", f"{waiting} that wait", f"fewer than {most_queued}; try again later"
                    )
            connection.execute(
                insert(jobs).values(
                    id=job_id,
                    kind=kind,
                    dataset_id=dataset_id,
                    volume_id=volume_id,
                    mesh_id=mesh_id,
                    field_id=field_id,
                    settings=settings,
                    plan=plan,
                    tenant=tenant,
                    idempotency_key=key,
                    request_sha256=digest,
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

    def newest(
        self, limit: int, state: str | None = None, kind: str | None = None, before: str | None = None
    ) -> list[Row]:
        """Up to ``limit`` jobs, newest first.

        Args:
            limit: at most how many.
            state, kind: only those.
            before: only those older than the job of this id.

        Raises:
            UnknownId: when there is no such job.
        """
        query = select(jobs).order_by(jobs.c.number.desc()).limit(limit)
        if state is not None:
            query = query.where(jobs.c.state == state)
        if kind is not None:
            query = query.where(jobs.c.kind == kind)
        if before is not None:
            query = query.where(jobs.c.number < self.get(before)["number"])
        with self._database.read() as connection:
            return [dict(row) for row in connection.execute(query).mappings()]

    def state(self, job_id: str) -> str:
        """The state of one job; cheap."""
        with self._database.read() as connection:
            return str(connection.execute(select(jobs.c.state).where(jobs.c.id == job_id)).scalar_one())

    def told(self, job_id: str) -> str | None:
        """The state of a job that this service runs; None when it has lost the job to another."""
        with self._database.read() as connection:
            return connection.execute(select(jobs.c.state).where(self._held(job_id))).scalar_one_or_none()

    def load(self) -> tuple[dict[str, int], float | None]:
        """How many jobs are in each state, and since when the oldest of those that wait is waiting."""
        with self._database.read() as connection:
            counts = connection.execute(select(jobs.c.state, func.count()).group_by(jobs.c.state))
            found = {state: int(count) for state, count in counts}
            waiting = select(func.min(jobs.c.created)).where(jobs.c.state == "queued")
            return found, connection.execute(waiting).scalar_one()

    def unfinished(self) -> set[str]:
        """The ids of all jobs that are not at their end."""
        with self._database.read() as connection:
            return set(connection.execute(select(jobs.c.id).where(jobs.c.state.not_in(ENDED))).scalars())

    def events(self, job_id: str, after: int = 0) -> list[Row]:
        """The appended events of one job, oldest first, from the one after number ``after``."""
        table = schema.events
        mine = select(table).where(table.c.job_id == job_id, table.c.number > after).order_by(table.c.number)
        with self._database.read() as connection:
            found = connection.execute(mine)
            return [dict(row) for row in found.mappings()]

    def claim(self) -> Row | None:
        """Turn a queued job into a running one of this service and return it; None when none waits.

        Of the tenants that wait, the one with the fewest running jobs is next, then the one whose last job
        began longest ago; of its jobs the oldest.
        """
        of_tenant = jobs.alias()
        same = of_tenant.c.tenant == jobs.c.tenant
        running = select(func.count()).where(same, of_tenant.c.state.in_(RUNNING)).scalar_subquery()
        served = select(func.coalesce(func.max(of_tenant.c.started), 0.0)).where(same).scalar_subquery()
        next_one = (
            select(jobs.c.id)
            .where(jobs.c.state == "queued")
            .order_by(running, served, jobs.c.number)
            .limit(1)
            .with_for_update(skip_locked=True)
        )
        with self._database.write() as connection:
            job_id = connection.execute(next_one).scalar_one_or_none()
            if job_id is None:
                return None
            now = time.time()
            fresh: Row = {
                "done": 0,
                "total": 0,
                "history": [],
                "attempts": jobs.c.attempts + 1,
                "started": now,
            }
            lease: Row = {"lease_owner": self._owner, "lease_until": now + LEASE_S}
            _change(connection, job_id, ("queued",), "running", self._owner, **fresh, **lease)
        return self.get(job_id)

    def renew(self) -> None:
        """Say that this service is still at work on its jobs."""
        with self._database.write() as connection:
            mine = jobs.c.lease_owner == self._owner, jobs.c.state.in_(RUNNING)
            connection.execute(update(jobs).where(*mine).values(lease_until=time.time() + LEASE_S))

    def got_further(self, job_id: str) -> None:
        """A job that has kept something is no job that kills its service: its attempts count anew."""
        with self._database.write() as connection:
            connection.execute(update(jobs).where(self._held(job_id), jobs.c.attempts > 1).values(attempts=1))

    def _held(self, job_id: str) -> ColumnElement[bool]:
        return and_(jobs.c.id == job_id, jobs.c.lease_owner == self._owner, jobs.c.state.in_(RUNNING))

    def progress(self, job_id: str, done: int, total: int, history: list[Row]) -> None:
        """Store how far a running job is."""
        with self._database.write() as connection:
            connection.execute(
                update(jobs).where(self._held(job_id)).values(done=done, total=total, history=history)
            )

    def succeed(self, job_id: str, result: Row | None, into: str = volumes.name) -> bool:
        """Store the success and the result, if there is one; False when it was cancelled in the meantime.

        Args:
            job_id: of the job.
            result: a row; where one with its id is there already, that one stays.
            into: the name of its table.
        """
        with self._database.write() as connection:
            now = time.time()
            advice = (result or {}).get("provenance", {}).get("advice")
            if not self._end(connection, job_id, ("running",), "succeeded", finished=now, advice=advice):
                return False
            if result is not None:
                table = schema.metadata.tables[into]
                there = select(table.c.id).where(table.c.id == result["id"])
                if connection.execute(there).first() is None:
                    connection.execute(insert(table).values(job_id=job_id, created=now, **result))
            return True

    def fail(self, job_id: str, problem: Row) -> None:
        """End a job with the problem that stopped it."""
        with self._database.write() as connection:
            note, now = str(problem["detail"])[:500], time.time()
            self._end(connection, job_id, RUNNING, "failed", note, finished=now, error=problem)

    def cancelled(self, job_id: str) -> None:
        """End a job that has stopped as it was asked to."""
        with self._database.write() as connection:
            self._end(connection, job_id, RUNNING, "cancelled", finished=time.time())

    def release(self, job_id: str, note: str) -> None:
        """Put a running job back in the queue for a reason that is no fault of the job."""
        with self._database.write() as connection:
            again: Row = {"started": None, "attempts": jobs.c.attempts - 1}
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
        """End a job of this service, or give it back; whether it was still its own and in ``before``."""
        held = jobs.c.lease_owner == self._owner
        return _change(
            connection, job_id, before, after, note, held, **values, lease_owner=None, lease_until=None
        )

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

    def recover(self, crashed: Row, *, alone: bool) -> int:
        """Take up what a dead service left: running jobs go back to the queue, cancelling ones end.

        A job that saw ``MAX_ATTEMPTS`` services die without getting any further is failed with the problem
        ``crashed``.

        Args:
            crashed: the problem.
            alone: no other service uses this database, so that what is running and not of this one is left
                over; otherwise its lease must have ended.

        Returns:
            how many wait again.
        """
        now, again = time.time(), 0
        dead = jobs.c.lease_owner.is_distinct_from(self._owner)
        if not alone:
            dead = and_(dead, func.coalesce(jobs.c.lease_until, 0.0) < now)
        left = select(jobs).where(jobs.c.state.in_(RUNNING), dead).with_for_update(skip_locked=True)
        free: Row = {"lease_owner": None, "lease_until": None}
        with self._database.write() as connection:
            for row in connection.execute(left).mappings().all():
                job_id = row["id"]
                if row["state"] == "cancelling":
                    _change(connection, job_id, ("cancelling",), "cancelled", finished=now, **free)
                elif row["attempts"] >= MAX_ATTEMPTS:
                    _change(connection, job_id, ("running",), "failed", finished=now, error=crashed, **free)
                else:
                    _change(
                        connection, job_id, ("running",), "queued", "the service died", started=None, **free
                    )
                    again += 1
        return again


def _change(
    connection: Connection,
    job_id: str,
    before: tuple[str, ...],
    after: str,
    note: str = "",
    only: ColumnElement[bool] | None = None,
    **values: Any,
) -> bool:
    """Change the state if it is one of ``before`` and ``only`` holds; whether it was changed."""
    where = [jobs.c.id == job_id, jobs.c.state.in_(before)]
    if only is not None:
        where.append(only)
    changed = connection.execute(update(jobs).where(*where).values(state=after, **values))
    if changed.rowcount:
        _event(connection, job_id, after, note)
    return bool(changed.rowcount)


def _of_key(connection: Connection, tenant: str, key: str) -> Row | None:
    """The job that was asked for under a key."""
    mine = select(jobs).where(jobs.c.tenant == tenant, jobs.c.idempotency_key == key)
    found = connection.execute(mine).mappings().one_or_none()
    return None if found is None else dict(found)


def _event(connection: Connection, job_id: str, state: str, note: str = "") -> None:
    connection.execute(insert(schema.events).values(job_id=job_id, time=time.time(), state=state, note=note))

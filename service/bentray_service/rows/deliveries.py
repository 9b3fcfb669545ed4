"""The table of messages to webhooks, and the secrets that sign them."""

from __future__ import annotations

import base64
import json
import secrets
import time
from collections.abc import Collection
from datetime import UTC, datetime
from typing import cast

from sqlalchemy import Connection, delete, func, insert, or_, select, update

from .accounts import account_in
from .database import Database
from .schema import deliveries, jobs, webhook_secrets
from .tenants import Tenant
from .typed_rows import DeliveryRow, Plain

# Time after which an attempt whose service died is repeated, s.
LEASE_S = 60.0
# Attempts under way at once for one account, so that its slow receivers delay no others.
OF_ACCOUNT = 2
# Time for which a replaced secret still signs, s.
OVERLAP_S = 86400.0
STATES = ("waiting", "delivered", "failed")
SECRET_PREFIX = "whsec_"  # noqa: S105 - the prefix of Standard Webhooks


def announce(connection: Connection, job_id: str, state: str) -> None:
    """Store the message that a job has ended, if it has a webhook; in the transaction of that change."""
    job = connection.execute(
        select(jobs.c.tenant, jobs.c.kind, jobs.c.webhook).where(jobs.c.id == job_id)
    ).one()
    if job.webhook is None:
        return
    now = time.time()
    # Ids only: names and notes may be about a patient.
    data = {"job": job_id, "kind": job.kind, "state": state, "address": f"/v1/jobs/{job_id}"}
    when = datetime.fromtimestamp(now, UTC).isoformat(timespec="milliseconds")
    body = json.dumps({"type": f"job.{state}", "timestamp": when, "data": data}, separators=(",", ":"))
    row = {"id": f"msg-{secrets.token_hex(10)}", "tenant": job.tenant, "job_id": job_id, "url": job.webhook}
    row |= {"body": body, "state": "waiting", "created": now, "due": now}
    connection.execute(insert(deliveries).values(**row))


class Deliveries:
    """Messages of all tenants, in the order in which they are due."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def of_job(self, tenant: Tenant, job_id: str) -> DeliveryRow | None:
        """The message of a job of this tenant; None before its end, or without a webhook."""
        mine = select(deliveries).where(deliveries.c.tenant == tenant, deliveries.c.job_id == job_id)
        rows = self._database.rows(mine)
        return cast(DeliveryRow, rows[0]) if rows else None

    def newest(self, tenant: Tenant | None, state: str | None, limit: int) -> list[DeliveryRow]:
        """Messages of one tenant or all, in one state or any, newest first."""
        query = select(deliveries).order_by(deliveries.c.number.desc()).limit(limit)
        if tenant is not None:
            query = query.where(deliveries.c.tenant == tenant)
        if state is not None:
            query = query.where(deliveries.c.state == state)
        return cast(list[DeliveryRow], self._database.rows(query))

    def counts(self) -> dict[str, int]:
        """The number of messages in each state."""
        query = select(deliveries.c.state, func.count()).group_by(deliveries.c.state)
        with self._database.read() as connection:
            return {**dict.fromkeys(STATES, 0), **{state: int(n) for state, n in connection.execute(query)}}

    def take_over(self) -> None:
        """Repeat the attempts of a dead service at once, if no other service uses the database."""
        with self._database.write() as connection:
            connection.execute(update(deliveries).values(lease_until=None))

    def claim(self) -> DeliveryRow | None:
        """Begin an attempt of a message that is due; None if there is none."""
        now = time.time()
        other = deliveries.alias()
        busy = (
            select(func.count())
            .where(account_in(other.c.tenant) == account_in(deliveries.c.tenant), other.c.lease_until > now)
            .scalar_subquery()
        )
        free = or_(deliveries.c.lease_until.is_(None), deliveries.c.lease_until <= now)
        due = deliveries.c.state == "waiting", deliveries.c.due <= now, free, busy < OF_ACCOUNT
        next_one = select(deliveries).where(*due).order_by(busy, deliveries.c.due).limit(1)
        # Most queries find nothing, and take no write lock.
        if not self._database.rows(next_one):
            return None
        with self._database.write() as connection:
            row = connection.execute(next_one.with_for_update(skip_locked=True)).mappings().one_or_none()
            if row is None:
                return None
            begun = {"attempts": row["attempts"] + 1, "lease_until": now + LEASE_S}
            connection.execute(update(deliveries).where(deliveries.c.id == row["id"]).values(**begun))
            return cast(DeliveryRow, {**row, **begun})

    def settle(self, delivery: DeliveryRow, state: str, entry: Plain, due: float) -> None:
        """End an attempt.

        Args:
            delivery: as it was claimed.
            state: of the message from now on.
            entry: of the log.
            due: time of the next attempt of a waiting message.
        """
        now: Plain = {"state": state, "log": [*delivery["log"], entry], "due": due, "lease_until": None}
        with self._database.write() as connection:
            connection.execute(update(deliveries).where(deliveries.c.id == delivery["id"]).values(**now))

    def retry(self, ids: Collection[str]) -> int:
        """Send failed messages again, with all attempts; returns their number."""
        again: Plain = {"state": "waiting", "attempts": 0, "due": time.time()}
        failed = deliveries.c.id.in_(ids), deliveries.c.state == "failed"
        with self._database.write() as connection:
            return connection.execute(update(deliveries).where(*failed).values(**again)).rowcount


class WebhookSecrets:
    """Secrets of tenants, in the form of Standard Webhooks: ``whsec_`` and base64."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def create(self, tenant: Tenant) -> str:
        """A new secret of a tenant; those before it still sign for ``OVERLAP_S``."""
        secret, now = SECRET_PREFIX + base64.b64encode(secrets.token_bytes(32)).decode(), time.time()
        mine = webhook_secrets.c.tenant == tenant
        with self._database.write() as connection:
            connection.execute(delete(webhook_secrets).where(mine, webhook_secrets.c.expires <= now))
            replaced = mine, webhook_secrets.c.expires.is_(None)
            connection.execute(update(webhook_secrets).where(*replaced).values(expires=now + OVERLAP_S))
            connection.execute(insert(webhook_secrets).values(tenant=tenant, secret=secret, created=now))
        return secret

    def of(self, tenant: Tenant) -> list[str]:
        """The valid secrets of a tenant, the newest first."""
        valid = or_(webhook_secrets.c.expires.is_(None), webhook_secrets.c.expires > time.time())
        query = select(webhook_secrets.c.secret).where(webhook_secrets.c.tenant == tenant, valid)
        rows = self._database.rows(query.order_by(webhook_secrets.c.number.desc()))
        return [row["secret"] for row in rows]

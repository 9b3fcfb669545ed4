"""The table of messages to webhooks, and the secrets that sign them."""

import base64
import json
import secrets
import time
from collections.abc import Collection
from datetime import UTC, datetime

from sqlalchemy import delete, func, or_, select, update
from sqlalchemy.orm import Session, aliased

from .accounts import account_in
from .database import Repository
from .ids import Tenant
from .tables import DeliveryRow, JobRow, Plain, WebhookSecretRow

# Time after which an attempt whose service died is repeated, s.
LEASE_S = 60.0
# Attempts under way at once for one account, so that its slow receivers delay no others.
OF_ACCOUNT = 2
# Time for which a replaced secret still signs, s.
OVERLAP_S = 86400.0
STATES = ("waiting", "delivered", "failed")
SECRET_PREFIX = "whsec_"  # noqa: S105 - the prefix of Standard Webhooks


def announce(session: Session, job_id: str, state: str) -> None:
    """Store the message that a job has ended, if it has a webhook; in the transaction of that change."""
    job = session.execute(select(JobRow.tenant, JobRow.kind, JobRow.webhook).where(JobRow.id == job_id)).one()
    if job.webhook is None:
        return
    now = time.time()
    # Ids only: names and notes may be about a patient.
    data = {"job": job_id, "kind": job.kind, "state": state, "address": f"/v1/jobs/{job_id}"}
    when = datetime.fromtimestamp(now, UTC).isoformat(timespec="milliseconds")
    body = json.dumps({"type": f"job.{state}", "timestamp": when, "data": data}, separators=(",", ":"))
    message = DeliveryRow(
        id=f"msg-{secrets.token_hex(10)}", tenant=job.tenant, job_id=job_id, url=job.webhook
    )
    message.body, message.state, message.created, message.due = body, "waiting", now, now
    session.add(message)


class Deliveries(Repository):
    """Messages of all tenants, in the order in which they are due."""

    def of_job(self, tenant: Tenant, job_id: str) -> DeliveryRow | None:
        """The message of a job of this tenant; None before its end, or without a webhook."""
        return self._database.row(select(DeliveryRow).filter_by(tenant=tenant, job_id=job_id))

    def newest(self, tenant: Tenant | None, state: str | None, limit: int) -> list[DeliveryRow]:
        """Messages of one tenant or all, in one state or any, newest first."""
        query = select(DeliveryRow).order_by(DeliveryRow.number.desc()).limit(limit)
        if tenant is not None:
            query = query.where(DeliveryRow.tenant == tenant)
        if state is not None:
            query = query.where(DeliveryRow.state == state)
        return self._database.rows(query)

    def counts(self) -> dict[str, int]:
        """The number of messages in each state."""
        query = select(DeliveryRow.state, func.count().label("number")).group_by(DeliveryRow.state)
        with self._database.read() as session:
            return {**dict.fromkeys(STATES, 0), **{row.state: row.number for row in session.execute(query)}}

    def take_over(self) -> None:
        """Repeat the attempts of a dead service at once, if no other service uses the database."""
        self._database.change(update(DeliveryRow).values(lease_until=None))

    def claim(self) -> DeliveryRow | None:
        """Begin an attempt of a message that is due; None if there is none."""
        now = time.time()
        other = aliased(DeliveryRow)
        busy = (
            select(func.count())
            .where(account_in(other.tenant) == account_in(DeliveryRow.tenant), other.lease_until > now)
            .scalar_subquery()
        )
        free = or_(DeliveryRow.lease_until.is_(None), DeliveryRow.lease_until <= now)
        due = DeliveryRow.state == "waiting", DeliveryRow.due <= now, free, busy < OF_ACCOUNT
        next_one = select(DeliveryRow).where(*due).order_by(busy, DeliveryRow.due).limit(1)
        # Most queries find nothing, and take no write lock.
        if not self._database.rows(next_one):
            return None
        with self._database.write() as session:
            row = session.scalar(next_one.with_for_update(skip_locked=True))
            if row is not None:
                row.attempts, row.lease_until = row.attempts + 1, now + LEASE_S
            return row

    def settle(self, delivery: DeliveryRow, state: str, entry: Plain, due: float) -> None:
        """End an attempt.

        Args:
            delivery: as it was claimed.
            state: of the message from now on.
            entry: of the log.
            due: time of the next attempt of a waiting message.
        """
        now: Plain = {"state": state, "log": [*delivery.log, entry], "due": due, "lease_until": None}
        self._database.change(update(DeliveryRow).where(DeliveryRow.id == delivery.id).values(**now))

    def retry(self, ids: Collection[str]) -> int:
        """Send failed messages again, with all attempts; returns their number."""
        again: Plain = {"state": "waiting", "attempts": 0, "due": time.time()}
        failed = DeliveryRow.id.in_(ids), DeliveryRow.state == "failed"
        return self._database.change(update(DeliveryRow).where(*failed).values(**again))


class WebhookSecrets(Repository):
    """Secrets of tenants, in the form of Standard Webhooks: ``whsec_`` and base64."""

    def create(self, tenant: Tenant) -> str:
        """A new secret of a tenant; those before it still sign for ``OVERLAP_S``."""
        secret, now = SECRET_PREFIX + base64.b64encode(secrets.token_bytes(32)).decode(), time.time()
        mine = WebhookSecretRow.tenant == tenant
        with self._database.write() as session:
            session.execute(delete(WebhookSecretRow).where(mine, WebhookSecretRow.expires <= now))
            replaced = mine, WebhookSecretRow.expires.is_(None)
            session.execute(update(WebhookSecretRow).where(*replaced).values(expires=now + OVERLAP_S))
            session.add(WebhookSecretRow(tenant=tenant, secret=secret, created=now))
        return secret

    def of(self, tenant: Tenant) -> list[str]:
        """The valid secrets of a tenant, the newest first."""
        valid = or_(WebhookSecretRow.expires.is_(None), WebhookSecretRow.expires > time.time())
        query = select(WebhookSecretRow.secret).where(WebhookSecretRow.tenant == tenant, valid)
        return self._database.rows(query.order_by(WebhookSecretRow.number.desc()))

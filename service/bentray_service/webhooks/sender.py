"""Sends the messages that are due, in threads of its own, until each is accepted or given up."""

from __future__ import annotations

import logging
import random
import threading
import time
from concurrent.futures import ThreadPoolExecutor

from sqlalchemy.exc import SQLAlchemyError

from bentray_kernels.errors import InvalidInput

from .. import __version__
from ..errors import DatabaseUnavailable
from ..rows.database import Database
from ..rows.deliveries import Deliveries, WebhookSecrets
from ..rows.ids import Tenant
from ..rows.tables import DeliveryRow
from ..settings import ServiceSettings
from ..web.addresses import networks
from .receiver import Outcome, check_url, post
from .signature import signed_headers

log = logging.getLogger("bentray.webhooks")

# Pauses before the second and later attempts, s; after the last one a message is given up, a day later.
PAUSES_S = (5.0, 60.0, 300.0, 1800.0, 7200.0, 21600.0, 43200.0)
# Pauses differ by this share, so that a receiver that was away is not called by all at once.
JITTER = 0.1
# Messages under way at once, and the interval between queries for further ones, s.
AT_ONCE = 4
IDLE_SECONDS = 2.0
STOP_SECONDS = 20.0
# The receiver wants no further messages.
GONE = 410


class Webhooks:
    """Accepts webhooks of jobs, and sends their messages."""

    def __init__(
        self,
        database: Database,
        settings: ServiceSettings,
        *,
        alone: bool,
    ) -> None:
        """Args:
        database: with the messages.
        settings: ``webhooks`` and ``webhook_networks``.
        alone: whether no other service uses the database.

        Raises:
            InvalidInput: for invalid networks.
        """
        self.deliveries, self._secrets = Deliveries(database), WebhookSecrets(database)
        self._on, self._alone = settings.webhooks, alone
        self._permitted = networks(settings.webhook_networks or "", "BENTRAY_WEBHOOK_NETWORKS")
        self._leaving = threading.Event()
        self._free = threading.Semaphore(AT_ONCE)
        self._pool = ThreadPoolExecutor(AT_ONCE, "webhooks")
        self._thread = threading.Thread(target=self._loop, name="webhooks", daemon=True)

    def check(self, tenant: Tenant, url: str | None) -> None:
        """Check the webhook of a request.

        Raises:
            InvalidInput: naming ``webhook``.
        """
        if url is None:
            return
        if not self._on:
            raise InvalidInput("webhook", "an address", "none: this service sends none (BENTRAY_WEBHOOKS)")
        check_url(url, self._permitted)
        if not self._secrets.of(tenant):
            command = f"bentray webhooks create-secret --tenant {tenant}"
            raise InvalidInput(
                "webhook", "an address, without a secret to sign messages", f"after `{command}`"
            )

    def start(self) -> None:
        """Begin to send, also what a service that died has left."""
        if self._alone:
            self.deliveries.take_over()
        self._thread.start()

    def alive(self) -> bool:
        """Whether the thread is alive."""
        return self._thread.is_alive()

    def stop(self) -> None:
        """End the threads; attempts under way end first."""
        self._leaving.set()
        self._thread.join(STOP_SECONDS)
        self._pool.shutdown(wait=True, cancel_futures=True)

    def _loop(self) -> None:
        while not self._leaving.is_set():
            try:
                if self._on and self._begin():
                    continue
            except DatabaseUnavailable:
                # Already logged.
                pass
            except Exception:
                log.exception("no message could be sent; next attempt in %g s", IDLE_SECONDS)
            self._leaving.wait(IDLE_SECONDS)

    def _begin(self) -> bool:
        """Start the next attempt, if any is due; returns whether one was started."""
        if not self._free.acquire(timeout=IDLE_SECONDS):
            return True
        delivery = None
        try:
            delivery = self.deliveries.claim()
        finally:
            if delivery is None:
                self._free.release()
        if delivery is None:
            return False
        self._pool.submit(self._attempt, delivery)
        return True

    def _attempt(self, delivery: DeliveryRow) -> None:
        try:
            self._send_once(delivery)
        except SQLAlchemyError as error:
            # Sent again with the same id when its lease ends.
            log.warning("the outcome of %s could not be stored: %s", delivery.id, error)
        except Exception:
            log.exception("%s could not be sent", delivery.id)
        finally:
            self._free.release()

    def _send_once(self, delivery: DeliveryRow) -> None:
        now, body = time.time(), delivery.body.encode()
        secrets = self._secrets.of(delivery.tenant)
        if secrets:
            headers = signed_headers(secrets, delivery.id, int(now), body)
            headers |= {"Content-Type": "application/json", "User-Agent": f"Bentray/{__version__}"}
            outcome = post(delivery.url, headers, body, self._permitted)
        else:
            outcome = Outcome(None, "the tenant has no secret to sign with", 0.0)
        attempt = delivery.attempts
        last = attempt > len(PAUSES_S) or outcome.status == GONE
        state = "delivered" if not outcome.error else "failed" if last else "waiting"
        pause = 0.0 if last else PAUSES_S[attempt - 1] * random.uniform(1 - JITTER, 1 + JITTER)  # noqa: S311
        entry = {"time": now, **outcome._asdict()}
        self.deliveries.settle(delivery, state, entry, time.time() + pause)
        # The address is not logged, since it may contain a secret of the receiver.
        words = "%s of %s, attempt %d: %s"
        level = logging.WARNING if state == "failed" else logging.INFO
        log.log(level, words, delivery.id, delivery.job_id, attempt, outcome.error or "delivered")

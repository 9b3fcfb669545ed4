"""Sends the messages that are due, in threads of its own, until each is accepted or given up."""

import logging
import random
import threading
import time
from concurrent.futures import ThreadPoolExecutor

from sqlalchemy.exc import SQLAlchemyError

from bentray_kernels.errors import InvalidInput

from .. import __version__
from ..background import BackgroundThread
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
# Messages under way at once.
AT_ONCE = 4
# The receiver wants no further messages.
GONE = 410


class Webhooks(BackgroundThread):
    """Accepts webhooks of jobs, and sends their messages."""

    idle_s, stop_s, failure = 2.0, 20.0, "no message could be sent"

    def __init__(self, database: Database, settings: ServiceSettings) -> None:
        """Args:
        database: with the messages.
        settings: ``webhooks`` and ``webhook_networks``.

        Raises:
            InvalidInput: for invalid networks.
        """
        super().__init__("webhooks")
        self.deliveries, self._secrets = Deliveries(database), WebhookSecrets(database)
        # No other service uses a database in the data folder.
        self._on, self._alone = settings.webhooks, settings.database_url is None
        self._permitted = networks(settings.webhook_networks or "", "BENTRAY_WEBHOOK_NETWORKS")
        self._free = threading.Semaphore(AT_ONCE)
        self._pool = ThreadPoolExecutor(AT_ONCE, "webhooks")

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
        super().start()

    def stop(self) -> None:
        """End the threads; attempts under way end first."""
        super().stop()
        self._pool.shutdown(wait=True, cancel_futures=True)

    def _step(self) -> bool:
        """Start the next attempt, if any is due; returns whether one was started."""
        if not self._on:
            return False
        if not self._free.acquire(timeout=self.idle_s):
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

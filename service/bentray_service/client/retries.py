"""Retries of idempotent requests while the service is unavailable."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, TypeVar

from .errors import ClientError, NoAnswer
from .steps import DownloadStep, Flow, FlowRun, PauseStep, RequestStep, Step

T = TypeVar("T")

# Time for which requests are retried, s.
PATIENCE_S = 300.0
# Pauses between attempts, s; each is twice the previous one.
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.5, 15.0

# Status codes of a proxy without its service, and of a service without its database.
UNAVAILABLE = (502, 503, 504)
# An internal error may be temporary, so it is retried a few times.
ERROR, MAX_ERRORS = 500, 5


def unavailable(error: ClientError) -> bool:
    """Whether the same request may succeed later."""
    return isinstance(error, NoAnswer) or error.status in (*UNAVAILABLE, ERROR)


class Retries:
    """Retries the requests of one client.

    Requests to a service that has never answered are not retried, since the address may be wrong.

    Args:
        seconds: time limit from the first attempt of a request.
        on_message: called with a message when retries begin and when they end.
    """

    def __init__(self, seconds: float, on_message: Callable[[str], None] | None) -> None:
        self._seconds = seconds
        self._on_message = on_message
        self._answered = False

    def through(self, flow: Flow[T]) -> Flow[T]:
        """The same flow with retries of its steps."""
        run = FlowRun(flow)
        outcome: Any = None
        while (step := run.next(outcome)) is not None:
            try:
                outcome = yield from self._done(step)
            except ClientError as error:
                outcome = error
        return run.result

    def _done(self, step: Step) -> Flow[Any]:
        begun, pause, errors, waits = time.monotonic(), FIRST_PAUSE_S, 0, False
        last = begun + self._seconds
        if isinstance(step, RequestStep) and step.until is not None:
            last = min(last, step.until)
        while True:
            try:
                result = yield step
            except ClientError as error:
                self._answered |= error.status is not None
                errors += error.status == ERROR
                pause = max(pause, error.retry_after_s or 0.0)
                if not (self._answered and repeatable(step, error) and errors < MAX_ERRORS):
                    raise
                if time.monotonic() + pause > last:
                    raise
                if not waits:
                    self._report(f"{error}; retrying for up to {last - begun:.0f} s.")
                waits = True
                yield PauseStep(pause)
                pause = min(2.0 * pause, LONGEST_PAUSE_S)
            else:
                self._answered |= not isinstance(step, PauseStep)
                if waits:
                    self._report("The service answers again.")
                return result

    def _report(self, line: str) -> None:
        if self._on_message is not None:
            self._on_message(line)


def repeatable(step: Step, error: ClientError) -> bool:
    """Whether a failed step can be repeated without side effects."""
    if not isinstance(step, RequestStep | DownloadStep) or not unavailable(error):
        return False
    never_sent = isinstance(error, NoAnswer) and not error.sent
    return never_sent or isinstance(step, DownloadStep) or step.repeatable

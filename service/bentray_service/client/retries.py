"""Retries of idempotent requests while the service is unavailable, by tenacity.

Not by stamina, which is for applications: it logs every retry, and its switches are global.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from tenacity import RetryCallState, stop_before_delay, wait_exponential

from .errors import ClientError, NoAnswer
from .steps import DownloadStep, PauseStep, RequestStep, Step

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

    def options(self, step: Step) -> dict[str, Any]:
        """The options of ``tenacity.Retrying`` and ``AsyncRetrying`` for one step, but for ``sleep``."""
        seconds, errors = self._seconds, 0
        if isinstance(step, RequestStep) and step.until is not None:
            seconds = min(seconds, step.until - time.monotonic())

        def again(state: RetryCallState) -> bool:
            nonlocal errors
            error = _error(state)
            if error is None:
                self._answered |= not isinstance(step, PauseStep)
                if state.attempt_number > 1:
                    self._report("The service answers again.")
                return False
            if not isinstance(error, ClientError):
                return False
            self._answered |= error.status is not None
            errors += error.status == ERROR
            return self._answered and repeatable(step, error) and errors < MAX_ERRORS

        def report(state: RetryCallState) -> None:
            if state.attempt_number == 1:
                self._report(f"{_error(state)}; retrying for up to {seconds:.0f} s.")

        stop = stop_before_delay(seconds)
        return {"retry": again, "wait": _pause, "stop": stop, "before_sleep": report, "reraise": True}

    def _report(self, line: str) -> None:
        if self._on_message is not None:
            self._on_message(line)


def _error(state: RetryCallState) -> BaseException | None:
    return None if state.outcome is None else state.outcome.exception()


def _pause(state: RetryCallState) -> float:
    pause = wait_exponential(FIRST_PAUSE_S, LONGEST_PAUSE_S)(state)
    return max(pause, getattr(_error(state), "retry_after_s", None) or 0.0)


def repeatable(step: Step, error: ClientError) -> bool:
    """Whether a failed step can be repeated without side effects."""
    if not isinstance(step, RequestStep | DownloadStep) or not unavailable(error):
        return False
    never_sent = isinstance(error, NoAnswer) and not error.sent
    return never_sent or isinstance(step, DownloadStep) or step.repeatable

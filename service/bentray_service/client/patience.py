"""While a service is away, what is safe to repeat is repeated, with pauses between."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, TypeVar

from .errors import ClientError, NoAnswer
from .steps import DownloadStep, Flow, PauseStep, RequestStep, Step

T = TypeVar("T")

# How long a service may be away before the client gives up, s.
PATIENCE_S = 300.0
# Between two attempts, s; each pause is twice the one before.
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.5, 15.0

# What a proxy answers while its service is away, and a service while its database is.
AWAY = (502, 503, 504)
# An error of the service may be a database that ends under it, or may never pass: it is tried so often.
ERROR, MOST_ERRORS = 500, 5


def away(error: ClientError) -> bool:
    """Whether the same request may succeed later."""
    return isinstance(error, NoAnswer) or error.status in (*AWAY, ERROR)


class Retries:
    """How long one client goes on asking.

    A service that has never answered is given up at once: its address may be wrong.

    Args:
        seconds: from the first attempt of a request to its last.
        told: called with a line when waiting begins and when it is over.
    """

    def __init__(self, seconds: float, told: Callable[[str], None] | None) -> None:
        self._seconds = seconds
        self._told = told
        self._answered = False

    def through(self, flow: Flow[T]) -> Flow[T]:
        """The same flow, each of its steps repeated where that is safe and worth while."""
        answer: Any = None
        error: ClientError | None = None
        while True:
            try:
                step = flow.send(answer) if error is None else flow.throw(error)
            except StopIteration as end:
                value: T = end.value
                return value
            try:
                answer, error = (yield from self._done(step)), None
            except ClientError as failure:
                answer, error = None, failure

    def _done(self, step: Step) -> Flow[Any]:
        begun, pause, errors, waits = time.monotonic(), FIRST_PAUSE_S, 0, False
        last = begun + self._seconds
        if isinstance(step, RequestStep) and step.until is not None:
            last = min(last, step.until)
        while True:
            try:
                answer = yield step
            except ClientError as error:
                self._answered |= error.status is not None
                errors += error.status == ERROR
                pause = max(pause, error.retry_after_s or 0.0)
                if not (self._answered and repeatable(step, error) and errors < MOST_ERRORS):
                    raise
                if time.monotonic() + pause > last:
                    raise
                if not waits:
                    self._say(f"{error}; trying again for up to {last - begun:.0f} s.")
                waits = True
                yield PauseStep(pause)
                pause = min(2.0 * pause, LONGEST_PAUSE_S)
            else:
                self._answered |= not isinstance(step, PauseStep)
                if waits:
                    self._say("The service answers again.")
                return answer

    def _say(self, line: str) -> None:
        if self._told is not None:
            self._told(line)


def repeatable(step: Step, error: ClientError) -> bool:
    """Whether a step that failed may be done again without doing anything twice."""
    if not isinstance(step, RequestStep | DownloadStep) or not away(error):
        return False
    never_sent = isinstance(error, NoAnswer) and not error.sent
    return never_sent or isinstance(step, DownloadStep) or step.repeatable

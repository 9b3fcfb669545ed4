"""Lines of the log: as words for a person or as JSON, with the request and the job, without any secret."""

from __future__ import annotations

import json
import logging
import re
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from datetime import UTC, datetime
from typing import Literal

# What is being worked on: the id of the request, of the job.
_ABOUT: ContextVar[dict[str, str]] = ContextVar("bentray_about")

# Whole keys, and passwords in addresses of databases; what is in the first group stays.
_SECRETS = (
    re.compile(r"(bentray_[0-9a-f]{12}_)[0-9a-f]{40}"),
    re.compile(r"(://[^\s:/@]*:)[^\s/@]+(?=@)"),
)

# Where Dask shows a traceback for what it still had to say when a connection closed, as at each stop. What is
# lost with a connection, others tell.
CLOSED = "distributed.batched"

# Loggers of what any client can bring about as often as it likes.
PROVOKED = ("bentray.connections", "uvicorn.error", "asyncio")
SELDOM_S = 60.0


@contextmanager
def about(**what: str) -> Iterator[None]:
    """Every line logged in the block, also by threads that it starts tasks in, says what it is about."""
    token = _ABOUT.set({**_ABOUT.get({}), **what})
    try:
        yield
    finally:
        _ABOUT.reset(token)


def without_secrets(text: str) -> str:
    """The same with ``***`` in place of every key and password."""
    for secret in _SECRETS:
        text = secret.sub(r"\1***", text)
    return text


class TextFormatter(logging.Formatter):
    """For a terminal; what a client sent cannot begin a line of its own."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - the name of the library
        return "".join(
            one if one.isprintable() else one.encode("unicode_escape").decode()
            for one in super().formatMessage(record)
        )

    def format(self, record: logging.LogRecord) -> str:
        said = super().format(record)
        named = ", ".join(f"{name} {value}" for name, value in _ABOUT.get({}).items())
        if named:
            first, line, rest = said.partition("\n")
            said = f"{first} ({named}){line}{rest}"
        return without_secrets(said)


class JsonFormatter(logging.Formatter):
    """JSON, one object a line."""

    def format(self, record: logging.LogRecord) -> str:
        line = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
            **_ABOUT.get({}),
            **getattr(record, "figures", {}),
        }
        if record.exc_info:
            line["error"] = self.formatException(record.exc_info)
        return without_secrets(json.dumps(line, default=str))


class _Stderr(logging.Handler):
    """Writes to whatever stderr is by then."""

    def emit(self, record: logging.LogRecord) -> None:
        try:
            sys.stderr.write(self.format(record) + "\n")
            sys.stderr.flush()
        except Exception:
            self.handleError(record)


class RateLimitFilter(logging.Filter):
    """Lets each kind of line through once in ``SELDOM_S``, with the number of those that were held back."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._clock = clock
        self._lock = threading.Lock()
        # By logger, level and words, oldest first: when it was let through, and how many were not since.
        self._known: dict[tuple[str, int, str], tuple[float, int]] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        key, now = (record.name, record.levelno, str(record.msg)), self._clock()
        with self._lock:
            at, held = self._known.get(key, (-SELDOM_S, 0))
            if now - at < SELDOM_S:
                self._known[key] = at, held + 1
                return False
            self._known.pop(key, None)
            self._known[key] = now, 0
            for old, (then, _) in list(self._known.items()):
                if now - then < 2 * SELDOM_S:
                    break
                del self._known[old]
        if held:
            record.msg, record.args = f"{record.getMessage()} (and {held} times since it was last said)", ()
        return True


@contextmanager
def configured(form: Literal["text", "json"]) -> Iterator[None]:
    """In the block every logger of this process writes to stderr, in one form.

    As words, what a person should know of; as JSON also a line for each request. What clients can bring about
    at will is told once a minute. Enter it once all that has
    handlers of its own, as Dask does, is imported.
    """
    handler = _Stderr()
    handler.setFormatter(TextFormatter() if form == "text" else JsonFormatter())
    root, own, closed = (logging.getLogger(name) for name in (None, "bentray", CLOSED))
    known = [logging.getLogger(name) for name in list(logging.Logger.manager.loggerDict)]
    before = [(logger, logger.handlers[:], logger.propagate, logger.level) for logger in (root, *known)]
    for logger, handlers, *_ in before:
        if handlers:
            logger.handlers[:] = []
            logger.propagate = True
    root.addHandler(handler)
    if form == "json":
        own.setLevel(logging.INFO)
    closed.setLevel(logging.WARNING)
    seldom, provoked = RateLimitFilter(), [logging.getLogger(name) for name in PROVOKED]
    for logger in provoked:
        logger.addFilter(seldom)
    try:
        yield
    finally:
        for logger in provoked:
            logger.removeFilter(seldom)
        for logger, handlers, propagate, level in before:
            logger.handlers[:], logger.propagate = handlers, propagate
            logger.setLevel(level)

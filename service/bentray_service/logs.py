"""Log formatters for text and JSON, with request and job ids and without secrets."""

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

# Ids of the current request and job.
_ABOUT: ContextVar[dict[str, str]] = ContextVar("bentray_about")

# API keys and passwords in database addresses; the first group is kept.
_SECRETS = (
    re.compile(r"(bentray_[0-9a-f]{12}_)[0-9a-f]{40}"),
    re.compile(r"(://[^\s:/@]*:)[^\s/@]+(?=@)"),
)

# Dask logs tracebacks of unsent messages when a connection is closed, also at every shutdown. Lost
# connections are logged elsewhere.
CLOSED = "distributed.batched"

# Loggers whose messages any client can trigger.
PROVOKED = ("uvicorn.error", "asyncio")
SELDOM_S = 60.0


@contextmanager
def about(**what: str) -> Iterator[None]:
    """Add ids to all log lines within the block, also in tasks started there."""
    token = _ABOUT.set({**_ABOUT.get({}), **what})
    try:
        yield
    finally:
        _ABOUT.reset(token)


def without_secrets(text: str) -> str:
    """Replace keys and passwords by ``***``."""
    for secret in _SECRETS:
        text = secret.sub(r"\1***", text)
    return text


class TextFormatter(logging.Formatter):
    """Format for a terminal; control characters from clients are escaped."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - the name of the library
        return "".join(
            character if character.isprintable() else character.encode("unicode_escape").decode()
            for character in super().formatMessage(record)
        )

    def format(self, record: logging.LogRecord) -> str:
        text = super().format(record)
        named = ", ".join(f"{name} {value}" for name, value in _ABOUT.get({}).items())
        if named:
            first, line, rest = text.partition("\n")
            text = f"{first} ({named}){line}{rest}"
        return without_secrets(text)


class JsonFormatter(logging.Formatter):
    """One JSON object per line."""

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
    """Writes to the current ``sys.stderr``."""

    def emit(self, record: logging.LogRecord) -> None:
        try:
            sys.stderr.write(self.format(record) + "\n")
            sys.stderr.flush()
        except Exception:
            self.handleError(record)


class RateLimitFilter(logging.Filter):
    """Passes each kind of message once per ``SELDOM_S``, with the number of suppressed ones."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._clock = clock
        self._lock = threading.Lock()
        # By logger, level and message, oldest first: time of the last output, suppressed messages since.
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
            record.msg, record.args = f"{record.getMessage()} (suppressed {held} times)", ()
        return True


@contextmanager
def configured(form: Literal["text", "json"]) -> Iterator[None]:
    """Send all loggers of this process to stderr within the block.

    Text has warnings; JSON also has one line per request. Messages that clients can trigger are limited to
    one per minute. To be entered after all imports that add handlers, such as Dask.
    """
    handler = _Stderr()
    handler.setFormatter(TextFormatter() if form == "text" else JsonFormatter())
    root, own, dask, closed = (logging.getLogger(name) for name in (None, "bentray", "distributed", CLOSED))
    loggers = [logging.getLogger(name) for name in list(logging.Logger.manager.loggerDict)]
    before = [(logger, logger.handlers[:], logger.propagate, logger.level) for logger in (root, *loggers)]
    for logger, handlers, *_ in before:
        if handlers:
            logger.handlers[:] = []
            logger.propagate = True
    root.addHandler(handler)
    if form == "json":
        own.setLevel(logging.INFO)
    else:
        # Dask sets its own level, INFO.
        dask.setLevel(logging.WARNING)
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

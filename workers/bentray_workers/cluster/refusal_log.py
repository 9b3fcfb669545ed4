"""What a worker logs of bad input that it refused: one line, since the user is told and nothing is broken."""

from __future__ import annotations

import logging

from bentray_kernels.errors import InvalidInput


def shorten(record: logging.LogRecord) -> bool:
    """A logging filter that keeps every record, and makes Dask's report of an InvalidInput one line."""
    message, given = str(record.msg), record.args
    if message.startswith("Compute Failed") and isinstance(given, tuple) and len(given) == 5:
        key, refused = given[0], str(given[3])
        if refused.startswith(InvalidInput.__name__):
            record.levelno, record.levelname = logging.WARNING, "WARNING"
            record.msg, record.args = "Refused: %s in %s", (refused, key)
    return True


def install() -> None:
    """Shorten what the workers of this process log; again has no effect."""
    logging.getLogger("distributed.worker").addFilter(shorten)

"""Log filter of workers: one line for rejected input, which is an error of the user only."""

from __future__ import annotations

import logging

from bentray_kernels.errors import InvalidInput


def shorten(record: logging.LogRecord) -> bool:
    """A logging filter that shortens the report of Dask on InvalidInput to one line, and drops no record."""
    message, arguments = str(record.msg), record.args
    if message.startswith("Compute Failed") and isinstance(arguments, tuple) and len(arguments) == 5:
        key, refused = arguments[0], str(arguments[3])
        if refused.startswith(InvalidInput.__name__):
            record.levelno, record.levelname = logging.WARNING, "WARNING"
            record.msg, record.args = "Rejected: %s in %s", (refused, key)
    return True


def install() -> None:
    """Install the filter for the workers of this process; repeated calls have no effect."""
    logging.getLogger("distributed.worker").addFilter(shorten)

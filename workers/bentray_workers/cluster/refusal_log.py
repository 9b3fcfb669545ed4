"""Log filter of workers: one line for rejected input and for a closed scheduler, which are no faults here."""

import logging

from bentray_kernels.errors import InvalidInput


def shorten(record: logging.LogRecord) -> bool:
    """A logging filter: InvalidInput in one line, and a lost scheduler at level INFO without its stack."""
    message, arguments = str(record.msg), record.args
    if message.startswith("Failed to communicate with scheduler during heartbeat"):
        # Also at the end of an embedded cluster, whose scheduler closes first and whose level is WARNING.
        record.levelno, record.levelname, record.exc_info = logging.INFO, "INFO", None
        return logging.getLogger(record.name).isEnabledFor(logging.INFO)
    if message.startswith("Compute Failed") and isinstance(arguments, tuple) and len(arguments) == 5:
        key, refused = arguments[0], str(arguments[3])
        if refused.startswith(InvalidInput.__name__):
            record.levelno, record.levelname = logging.WARNING, "WARNING"
            record.msg, record.args = "Rejected: %s in %s", (refused, key)
    return True


def install() -> None:
    """Install the filter for the workers of this process; repeated calls have no effect."""
    logging.getLogger("distributed.worker").addFilter(shorten)

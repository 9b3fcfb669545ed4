"""The problem stored with a failed job."""

from __future__ import annotations

import errno
import logging
import secrets

from distributed import KilledWorker

from bentray_kernels.errors import InvalidInput

from ..web.errors import FAILED, INTERNAL, make_problem, problem_of
from ..web.problem import Problem

log = logging.getLogger("bentray.jobs")

CRASHED = make_problem(
    FAILED, "the service crashed several times while it ran this job; the job is not repeated"
)


def explain(job_id: str, error: BaseException) -> Problem:
    """Convert an error to a problem; unexpected errors are logged with a correlation id."""
    instance = f"/v1/jobs/{job_id}"
    if isinstance(error, InvalidInput):
        return problem_of(error, instance)
    if isinstance(error, MemoryError):
        return make_problem(FAILED, "out of memory: use fewer nodes or fewer slices", instance=instance)
    if isinstance(error, KilledWorker):
        words = "the workers that ran this job died one after another, usually for lack of memory"
        return make_problem(FAILED, words, instance=instance)
    if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
        return make_problem(FAILED, "the disk of the service is full", instance=instance)
    number = secrets.token_hex(8)
    log.error("job %s failed [%s]", job_id, number, exc_info=error)
    words = f"internal error of the service; see the log entry {number}"
    return make_problem(INTERNAL, words, instance=instance, correlation_id=number)

"""Why a job failed: known causes as messages, unknown ones under an incident number."""

import errno
import logging

import pytest
from distributed import KilledWorker

from bentray_kernels.errors import InvalidInput
from bentray_service.jobs.reporter import explain


def test_bad_input_keeps_its_fields():
    problem = explain("job-1", InvalidInput("speed", -1, "more than 0"))
    assert (problem.field, problem.found, problem.accepted) == ("speed", "-1", "more than 0")
    assert problem.instance == "/v1/jobs/job-1"


@pytest.mark.parametrize(
    ("error", "word"),
    [
        (MemoryError(), "memory"),
        (OSError(errno.ENOSPC, "full"), "disk"),
        (KilledWorker("task", None, 3), "workers"),
    ],
)
def test_known_causes(error, word):
    assert word in explain("job-1", error).detail


def test_unexpected_errors_are_logged(caplog):
    with caplog.at_level(logging.ERROR, "bentray.jobs"):
        problem = explain("job-1", RuntimeError("the secret inside"))
    assert "secret" not in problem.detail
    assert problem.correlation_id in caplog.text
    assert "the secret inside" in caplog.text

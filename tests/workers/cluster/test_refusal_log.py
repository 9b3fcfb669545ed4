"""Rejected input is one line in the log of a worker, a closed scheduler none; a fault keeps its traceback."""

import logging

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_workers.cluster.refusal_log import shorten


def refuse():
    raise InvalidInput("iso", 7, "0 to 1")


def fail():
    raise RuntimeError("broken")


@pytest.mark.parametrize(
    ("task", "error", "traced"), [(refuse, InvalidInput, False), (fail, RuntimeError, True)]
)
def test_the_log_of_a_task_that_raises(cluster, caplog, task, error, traced):
    with caplog.at_level(logging.INFO, "distributed.worker"), pytest.raises(error):
        cluster.client.submit(task, pure=False).result()
    (said,) = (record.getMessage() for record in caplog.records if error.__name__ in record.getMessage())
    assert ("\n" in said, "Traceback" in said) == (traced, traced)


@pytest.mark.parametrize("level", [logging.INFO, logging.WARNING])
def test_a_heartbeat_to_a_closed_scheduler_is_no_error(level):
    log = logging.getLogger("distributed.worker.test")
    log.setLevel(level)
    error = (OSError, OSError("Stream is closed"), None)
    said = "Failed to communicate with scheduler during heartbeat."
    record = log.makeRecord(log.name, logging.ERROR, "worker.py", 1, said, (), error)
    assert shorten(record) == (level == logging.INFO)
    assert (record.levelname, record.exc_info) == ("INFO", None)

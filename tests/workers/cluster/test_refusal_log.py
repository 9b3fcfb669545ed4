"""Bad input that a worker refuses is one line of its log; a fault keeps its traceback."""

import logging

import pytest

from bentray_kernels.errors import InvalidInput


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
    (said,) = (one.getMessage() for one in caplog.records if error.__name__ in one.getMessage())
    assert ("\n" in said, "Traceback" in said) == (traced, traced)

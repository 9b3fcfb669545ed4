"""Attempts: a call that only waited on a dead worker is innocent, one that ran there is not for ever."""

import pytest
from distributed import KilledWorker

from bentray_workers import attempts
from bentray_workers.attempts import MOST_STRIKES, Attempts, watched


class Future:
    """One that ends as the test says."""

    def __init__(self, work):
        self.work = work
        self.status = "pending"
        self.error = None

    def exception(self):
        return self.error

    def killed(self, while_running):
        if while_running:
            self.work[0].touch()
        self.status, self.error = "error", KilledWorker("task", None, 2)
        return self


class Client:
    def submit(self, task, *work, resources, pure):
        assert task is watched
        assert (resources, pure) == (attempts.RECONSTRUCTION, False)
        return Future(work)


@pytest.fixture
def made(tmp_path):
    return Attempts(Client(), tmp_path / "work")


def test_who_only_waited_is_tried_again_for_ever(made):
    future = made.submit(print, 1)
    for _ in range(20):
        future = made.again(future.killed(while_running=False))
        assert future.work[1:] == (print, 1)


def test_who_ran_is_given_up(made):
    future = made.submit(print, 1)
    for _ in range(MOST_STRIKES):
        future = made.again(future.killed(while_running=True))
        assert future is not None
        assert not future.work[0].exists()
    assert made.again(future.killed(while_running=True)) is None


@pytest.mark.parametrize(
    ("status", "error"), [("finished", None), ("error", ValueError()), ("cancelled", None)]
)
def test_every_other_end_is_an_end(made, status, error):
    future = made.submit(print)
    future.status, future.error = status, error
    assert made.again(future) is None


def test_the_file_is_there_as_long_as_the_call_runs(tmp_path):
    marker = tmp_path / "call"
    seen = []

    def work(value):
        seen.append(marker.exists())
        if value < 0:
            raise ValueError(value)
        return value

    assert watched(marker, work, 3) == 3
    with pytest.raises(ValueError, match="-1"):
        watched(marker, work, -1)
    assert seen == [True, True]
    assert not marker.exists()

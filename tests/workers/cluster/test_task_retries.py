"""Retries: a task that only waited on a dead worker is always retried, one that ran there a few times."""

import distributed
import pytest
from distributed import KilledWorker

from bentray_kernels.opencl import DeviceLostError
from bentray_kernels.opencl.lost_device import cpu_only
from bentray_kernels.task_graph import Task
from bentray_workers.cluster import task_retries
from bentray_workers.cluster.task_retries import MAX_DEATHS, Attempts, ResultsLostError, marked


class Future(distributed.Future):
    """One that ends as the test says."""

    status = "pending"
    __hash__ = object.__hash__
    __eq__ = object.__eq__

    def __init__(self, work):
        self.work = work
        self.error = None

    def __repr__(self):
        return f"<{self.status} {self.work[2:]}>"

    def __del__(self):
        """Nothing of a real one is to be released."""

    def result(self):
        if self.error is not None:
            raise self.error
        return "given"

    def ended(self, status, error=None):
        self.status, self.error = status, error
        return self

    def killed(self, while_running):
        if while_running:
            self.work[0].touch()
        return self.ended("error", KilledWorker("task", None, 2))


class Client:
    def submit(self, task, *work, resources, priority, pure):
        assert task is marked
        assert (resources, pure) == (task_retries.RECONSTRUCTION, False)
        return Future(work)


@pytest.fixture
def made(tmp_path):
    return Attempts(Client(), tmp_path / "work")


def test_tasks_that_only_waited_are_always_retried(made):
    future = made.submit(Task(print, (1,)))
    for _ in range(20):
        future, _ = made.result(future.killed(while_running=False))
        assert future.work[3:] == (print, 1)


def test_tasks_that_killed_workers_are_abandoned(made):
    future = made.submit(Task(print, (1,)))
    for _ in range(MAX_DEATHS):
        future, _ = made.result(future.killed(while_running=True))
        assert not future.work[0].exists()
    with pytest.raises(KilledWorker):
        made.result(future.killed(while_running=True))


def test_lost_result_is_recomputed(made):
    future = made.submit(Task(print, (1,)))
    future.killed(while_running=False).status = "finished"
    again, _ = made.result(future)
    assert again.work[3:] == (print, 1)


def test_results_kept_on_workers_are_not_fetched(made):
    future = made.submit(Task(print, keep_on_worker=True))
    future.error = AssertionError("it was fetched")
    future.status = "finished"
    assert made.result(future) == (None, future)


def test_retries_of_lost_results_are_bounded(made):
    needed = made.submit(Task(print)).ended("finished")
    future = made.submit(Task(print, ([needed], 1)))
    future, _ = made.result(future.killed(while_running=False))
    needed.status = "error"
    with pytest.raises(ResultsLostError):
        made.result(future.killed(while_running=False))


def test_an_end_is_an_end(made):
    assert made.result(made.submit(Task(print)).ended("finished")) == (None, "given")
    with pytest.raises(ZeroDivisionError):
        made.result(made.submit(Task(print, (), True)).ended("error", ZeroDivisionError()))


def test_attempt_file_exists_while_the_task_runs(tmp_path):
    marker = tmp_path / "call"
    seen = []

    def work(value):
        seen.append(marker.exists())
        if value < 0:
            raise ValueError(value)
        return value

    assert marked(marker, True, work, 3) == 3
    with pytest.raises(ValueError, match="-1"):
        marked(marker, True, work, -1)
    assert seen == [True, True]
    assert not marker.exists()


def test_a_lost_device_is_replaced_by_the_processor_once(tmp_path):
    runs = []

    def work(value):
        runs.append(cpu_only())
        if not cpu_only():
            raise DeviceLostError("gone")
        return 2 * value

    assert marked(tmp_path / "marker", False, work, 3) == 6
    assert runs == [False, True]
    assert not (tmp_path / "marker").exists()

    def broken():
        runs.append(cpu_only())
        raise DeviceLostError("gone for good")

    with pytest.raises(DeviceLostError, match="for good"):
        marked(tmp_path / "marker", False, broken)
    assert runs[2:] == [False, True]

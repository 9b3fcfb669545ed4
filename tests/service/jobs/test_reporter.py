"""The reporter: a few writes a second, the last report always, and why a job failed."""

import errno
import json
import logging

import pytest
from distributed import KilledWorker
from sqlalchemy.exc import OperationalError

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography.result import Iteration, Progress
from bentray_service.jobs.reporter import MEASURE_SECONDS, Reporter, explain

from ...clock import Clock


class FakeJobs:
    def __init__(self):
        self.written = []
        self.asked = 0
        self.now = "running"
        self.away = False
        self.further = 0
        self.sizes = []

    def reset_attempts(self, job_id):
        self.check()
        self.further += 1

    def record_size(self, job_id, size):
        self.check()
        self.sizes.append(size)

    def check(self):
        if self.away:
            raise OperationalError("select", {}, Exception("database is locked"))

    def progress(self, job_id, done, total, history, phase):
        self.check()
        self.written.append((done, total, history, phase))

    def held_state(self, job_id):
        self.check()
        self.asked += 1
        return self.now


def test_writes_are_throttled_and_the_last_one_arrives():
    jobs, clock = FakeJobs(), Clock()
    reporter = Reporter(jobs, "job", lambda: False, clock)
    for done in range(1, 1001):
        clock.now += 0.001
        reporter.report(Progress(done, 1000, phase="picking"))
    reporter.flush()
    assert len(jobs.written) <= 5
    assert jobs.written[-1] == (1000, 1000, [], "picking")
    reporter.flush()
    assert [done for done, _, _, _ in jobs.written].count(1000) == 1


def test_a_report_soon_after_another_is_written_while_a_task_takes_long():
    jobs, clock = FakeJobs(), Clock()
    reporter = Reporter(jobs, "job", lambda: False, clock)
    reporter.report(Progress(1, 9))
    clock.now += 0.01
    reporter.report(Progress(2, 9))
    assert [done for done, *_ in jobs.written] == [1]
    for _ in range(20):
        clock.now += 0.05
        assert not reporter.stop()
    assert [done for done, *_ in jobs.written] == [1, 2]


def test_a_residual_that_json_cannot_hold():
    jobs = FakeJobs()
    Reporter(jobs, "job", lambda: False).report(Progress(1, 1, (Iteration(0, 1, float("nan"), 0, 2),)))
    told = {"slice": 0, "sweep": 1, "residual_rms_s": None, "emitters": 0, "stage": 2, "given": True}
    waves = {"band_hz": None, "misfit": None, "held_out_misfit": None, "of_attenuation": False}
    assert jobs.written[0][2] == [told | waves]


def test_stop_polls_the_database():
    jobs, clock = FakeJobs(), Clock()
    reporter = Reporter(jobs, "job", lambda: False, clock)
    for _ in range(1000):
        clock.now += 0.001
        assert not reporter.stop()
    assert jobs.asked <= 5
    jobs.now = "cancelling"
    clock.now += 1
    assert reporter.stop()
    assert reporter.stop()


def test_unavailable_database_fails_no_job():
    jobs, clock = FakeJobs(), Clock()
    reporter = Reporter(jobs, "job", lambda: False, clock)
    jobs.away = True
    reporter.report(Progress(1, 2))
    assert not reporter.stop()
    jobs.away = False
    reporter.flush()
    assert jobs.written[-1][:2] == (1, 2)


def test_stop_when_the_service_leaves():
    jobs = FakeJobs()
    assert Reporter(jobs, "job", lambda: True).stop()
    assert jobs.asked == 0


def test_checkpoints_are_reported_once_and_their_size_periodically():
    jobs, clock = FakeJobs(), Clock()
    reporter = Reporter(jobs, "job", lambda: False, clock, taken=lambda: 7)
    jobs.away = True
    reporter.saved()
    jobs.away = False
    for _ in range(5):
        reporter.saved()
    assert jobs.further == 1
    assert jobs.sizes == [7]
    clock.now += MEASURE_SECONDS
    reporter.saved()
    assert jobs.sizes == [7, 7]


def test_a_job_that_another_service_runs_is_left():
    jobs = FakeJobs()
    reporter = Reporter(jobs, "job", lambda: False)
    assert not reporter.lost
    jobs.now = None
    assert reporter.stop()
    assert reporter.lost


def test_the_record_of_a_long_job_does_not_grow():
    jobs, clock = FakeJobs(), Clock()
    reporter = Reporter(jobs, "job", lambda: False, clock)
    history = tuple(Iteration(index, 1, 1e-6, 8) for index in range(30_000))
    for count in (1, 499, 500, 501, 30_000):
        clock.now += 10.0
        reporter.report(Progress(count, 600_001, history[:count]))
        told = [sweep["slice"] for sweep in jobs.written[-1][2]]
        assert len(told) == min(count, 500)
        assert (told[0], told[-1]) == (0, count - 1)
    assert told == sorted(set(told))
    assert len(json.dumps(jobs.written[-1][2])) < 150_000
    written = len(jobs.written)
    for _ in range(10):
        clock.now += 0.3
        reporter.report(Progress(count, 600_001, history))
    assert len(jobs.written) - written == 1, "a long record is written more seldom"


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

"""Scaling model of one scheduler: fitted costs equal those of synthetic runs, and limits follow."""

import pytest
from benchmarks.cluster._scaling_cluster import Run
from benchmarks.cluster._scaling_model import BUSY, Model, beats
from benchmarks.cluster._scaling_work import Work
from hypothesis import given
from hypothesis import strategies as st

WORK = Work(tasks=6, seconds=0.08, sent=2.6e5, returned=2.6e5)

costs = st.floats(1e-5, 1e-2)


@given(task=costs, beat=costs, idle=costs, driver=costs)
def test_costs_are_found_again(task: float, beat: float, idle: float, driver: float) -> None:
    runs = [
        Run(workers, length, tasks, 5.0, tasks * task + 5.0 * (beats(workers) * beat + idle), tasks * driver)
        for workers in (1, 2, 4, 8)
        for length, tasks in ((0.0, 0), (0.08, 60 * workers), (0.02, 150 * workers))
    ]
    model = Model.fitted(WORK, runs)
    result = (model.scheduler_task, model.scheduler_beat, model.scheduler_idle, model.driver_task)
    assert result == pytest.approx((task, beat, idle, driver), rel=1e-6, abs=1e-9)


@given(task=costs, driver=costs, length=st.floats(0.01, 10.0))
def test_at_the_limit_the_busier_process_is_as_busy_as_allowed(
    task: float, driver: float, length: float
) -> None:
    model = Model(WORK, task, 1e-4, 1e-3, driver)
    most = model.most_workers(length)
    if most > 2.0:
        assert max(model.scheduler_share(most, length), model.driver_share(most, length)) < BUSY
        assert max(model.scheduler_share(most + 1, length), model.driver_share(most + 1, length)) >= BUSY
        assert model.length_for(most) <= length


def test_workers_follow_from_the_seconds_of_a_day() -> None:
    model = Model(WORK, 1e-3, 1e-4, 1e-3, 1e-3)
    seconds = 10_000 * 40 * 6 * 0.08
    assert model.workers_for(10_000, 40) == pytest.approx(seconds / 86_400 / BUSY)


def test_heartbeats_become_rarer_with_many_workers() -> None:
    assert beats(8) == 16
    assert 1000 / beats(1000) > 4.0

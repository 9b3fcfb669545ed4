"""Estimates: counted work times what finished jobs took; none where nothing is known."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_service.jobs.estimate import COMPARED, ENOUGH, estimate


def plan(work_s, name="sart", known=True):
    return {"work_class": name, "work_s": work_s, "speed_known": known}


@given(st.lists(st.floats(0.1, 1e4), min_size=1, max_size=30), st.floats(0.1, 1e4))
def test_a_machine_of_constant_speed_is_predicted(works, asked):
    estimated = estimate(plan(asked), [(plan(work), 7.0 * work) for work in works])
    assert estimated.minutes == pytest.approx(7.0 * asked / 60.0)
    assert estimated.compared == min(len(works), COMPARED)
    assert estimated.rough == (len(works) < ENOUGH)


def test_one_job_that_took_far_too_long_does_not_count():
    finished = [(plan(10.0), 20.0), (plan(10.0), 9000.0), (plan(10.0), 20.0)]
    assert estimate(plan(30.0), finished).minutes == pytest.approx(1.0)


def test_the_last_jobs_count():
    finished = [(plan(1.0), 2.0)] * COMPARED + [(plan(1.0), 100.0)] * 50
    assert estimate(plan(30.0), finished).minutes == pytest.approx(1.0)


def test_jobs_of_earlier_versions_and_of_classes_without_a_speed_do_not_count():
    unknown = plan(1.0, "volume", known=False)
    finished = [(unknown, 50.0), ({}, 3.0), ({"tasks": 3, "work_s": None}, 3.0)]
    estimated = estimate(plan(90.0), finished)
    assert (estimated.minutes, estimated.compared, estimated.rough) == (1.5, 0, True)
    assert "another machine" in estimated.basis


def test_jobs_of_other_classes_tell_the_speed_of_this_machine():
    # A start of 4 s each: the long job says more about the speed than the short one.
    finished = [(plan(1.0, "gauss-newton"), 7.0), (plan(99.0, "automatic"), 301.0)]
    estimated = estimate(plan(90.0), finished)
    assert (estimated.minutes, estimated.compared, estimated.rough) == (pytest.approx(1.5 * 3.08), 0, True)
    assert "other methods" in estimated.basis
    # One of its own class counts alone.
    assert estimate(plan(90.0), [*finished, (plan(10.0), 20.0)]).minutes == pytest.approx(3.0)


def test_without_a_known_speed_only_jobs_give_an_estimate():
    unknown = plan(60.0, "volume", known=False)
    assert estimate(unknown, []).minutes is None
    assert estimate(unknown, [(plan(1.0), 5.0)]).minutes is None
    estimated = estimate(unknown, [(plan(30.0, "volume", known=False), 90.0)])
    assert (estimated.minutes, estimated.rough) == (3.0, True)


def test_simulations_by_their_minutes_and_other_kinds_not_at_all():
    assert estimate({"minutes": 2.0}, []).minutes == 2.0
    assert estimate({"minutes": 2.0}, [({"minutes": 1.0}, 30.0)]).minutes == pytest.approx(1.0)
    assert estimate(None, [(plan(1.0), 5.0)]).minutes is None

"""Observed time: persistent, paused without a service, and not faster with several."""

import pytest

from bentray_service.rows.ages import ObservedTime

from ...clock import Clock


def test_observed_time_continues_after_restart(database):
    for run in range(3):
        clock = Clock()
        observed = ObservedTime(database, clock)
        assert observed.count() == 20.0 * run
        clock.now = 20.0
        assert observed.count() == 20.0 * (run + 1)


@pytest.mark.parametrize("several", [1, 2, 5])
def test_several_count_the_same_time(database, several):
    clock = Clock()
    clocks = [ObservedTime(database, clock) for _ in range(several)]
    for _ in range(10):
        for observed in clocks:
            clock.now += 1.0
            observed.count()
    clock.now += 1.0
    assert clock.now - several <= clocks[0].count() <= clock.now

"""Rate limits: so many in a minute, never more, and each account by itself."""

import time
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_service.access.rate_limits import RateLimits


@pytest.fixture
def clock(monkeypatch):
    moved = SimpleNamespace(now=1e9)
    monkeypatch.setattr(time, "time", lambda: moved.now)
    return moved


@given(st.integers(1, 50), st.lists(st.floats(0.0, 40.0), max_size=120))
def test_requests_are_bounded_and_the_stated_time_is_enough(per_minute, waits):
    now, taken = 1e9, 0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(time, "time", lambda: now)
        limits = RateLimits(per_minute)
        for wait in waits:
            now += wait
            delay = limits.take("a")
            if delay:
                now += delay + 1e-6
                assert limits.take("a") == 0.0
            taken += 1
            assert taken <= per_minute * (1.0 + (now - 1e9) / 60.0) + 1e-6
        assert limits.take("b") == 0.0


def test_zero_is_unlimited():
    limits = RateLimits(0)
    assert {limits.take("a") for _ in range(1000)} == {0.0}


def test_requests_of_little_work_count_a_share(clock):
    limits = RateLimits(60)
    assert {limits.take("a", 0.125) for _ in range(299)} == {0.0}
    clock.now += 20.0
    assert limits.take("a") == pytest.approx(40.0), "two tenths are left"
    assert limits.take("a", 0.125) == 0.0
    assert limits.take("a", 0.125) == pytest.approx(40.0)


def test_ended_minutes_are_forgotten(clock):
    limits = RateLimits(60)
    for number in range(100):
        limits.take(str(number))
    clock.now += 61.0
    storage, deadline = limits._limiter.storage, time.monotonic() + 2.0
    while len(storage.storage) > 1 and time.monotonic() < deadline:
        limits.take("new")
        time.sleep(0.02)
    assert len(storage.storage) == len(storage.expirations) == 1

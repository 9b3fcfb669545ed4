"""Buckets: so many in a minute, never more, and each tenant by itself."""

from hypothesis import given
from hypothesis import strategies as st

from bentray_service.access import rate_limits
from bentray_service.access.rate_limits import RateLimits

from ...clock import Clock
from ..conftest import signed


@given(st.integers(1, 50), st.lists(st.floats(0.0, 40.0), max_size=120))
def test_rate_is_bounded_by_bucket_size_and_refill(per_minute, waits):
    clock = Clock()
    limits, taken = RateLimits(per_minute, clock), 0
    for wait in waits:
        clock.now += wait
        delay = limits.take("a")
        taken += delay == 0.0
        assert taken <= per_minute * (1.0 + clock.now / 60.0) + 1e-6
        if delay:
            clock.now += delay * (1.0 + 1e-9) + 1e-9
            assert limits.take("a") == 0.0, "what it says is enough"
            taken += 1
    assert limits.take("b") == 0.0


def test_nought_is_any_number():
    limits = RateLimits(0)
    assert {limits.take("a") for _ in range(1000)} == {0.0}


def test_a_request_for_what_workers_compute_counts_one(start, work, uploaded):
    http = start(renders_per_minute=2)
    http.app.state.access.sign_in._renders._clock = Clock()
    http.headers.update(signed(http))
    here = f"/v1/datasets/{uploaded(http)}/geometry"
    assert [http.get(here).status_code for _ in range(3)] == [200, 200, 429]


def test_full_buckets_are_dropped(monkeypatch):
    monkeypatch.setattr(rate_limits, "MANY", 10)
    clock = Clock()
    limits = RateLimits(60, clock)
    for number in range(9):
        limits.take(str(number))
    for _ in range(60):
        limits.take("busy")
    clock.now = 2.0
    limits.take("new")
    assert limits.take("busy") == 0.0
    assert len(limits._buckets) == 2


def test_what_takes_little_work_counts_a_share():
    clock = Clock()
    limits = RateLimits(60, clock)
    assert {limits.take("a", 0.125) for _ in range(479)} == {0.0}
    assert limits.take("a") == 0.875, "an eighth is left, and one a second comes"
    assert limits.take("a", 0.125) == 0.0
    assert limits.take("a", 0.125) == 0.125

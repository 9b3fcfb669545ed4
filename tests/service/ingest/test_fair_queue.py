"""Uploads on their way: turns of tenants in the queue, and how many of one, in all and begun in a minute."""

import threading
from contextlib import ExitStack

import pytest

from bentray_service.errors import Busy, RateLimited
from bentray_service.ingest import fair_queue
from bentray_service.ingest.fair_queue import FairQueue, readers_at_once
from bentray_service.ingest.upload_ingest import UploadLimits
from bentray_service.rows.ids import Tenant

from ..conftest import NoProjects

PATIENCE_S = 60.0


BUSY, SMALL, THIRD = Tenant("busy"), Tenant("small"), Tenant("third")


@pytest.fixture
def start():
    """Start a queue; whatever still runs at the end is let go."""
    made = []

    def go(at_once):
        queue = FairQueue(at_once, NoProjects())
        queue.start()
        made.append(queue)
        return queue

    yield go
    for queue in made:
        queue.stop()
        assert not any(thread.is_alive() for thread in queue._threads)


class Held:
    """Work that says when it begins, and ends when it is let go."""

    def __init__(self):
        self.began, self.go = threading.Event(), threading.Event()

    def __call__(self):
        self.began.set()
        assert self.go.wait(PATIENCE_S)


def test_a_small_upload_does_not_wait_for_four_of_another_tenant(start):
    queue = start(3)
    large = [Held() for _ in range(4)]
    futures = [queue.submit(BUSY, work) for work in large]
    for work in large[:2]:
        assert work.began.wait(PATIENCE_S)
    assert queue.submit(SMALL, lambda: "read").result(PATIENCE_S) == "read"
    # Two at once for one tenant, the others wait in the order in which they came.
    assert [work.began.is_set() for work in large] == [True, True, False, False]
    for work in large:
        work.go.set()
    for future in futures:
        future.result(PATIENCE_S)


def test_tenants_take_turns_and_uploads_of_one_go_in_order(start):
    queue, first, order = start(1), Held(), []
    begun = queue.submit(BUSY, first)
    assert first.began.wait(PATIENCE_S)
    asked = [(BUSY, 2), (BUSY, 3), (BUSY, 4), (SMALL, 1), (SMALL, 2), (THIRD, 1)]
    futures = [queue.submit(who, lambda one=(who, n): order.append(one)) for who, n in asked]
    first.go.set()
    for future in (begun, *futures):
        future.result(PATIENCE_S)
    assert order == [(SMALL, 1), (THIRD, 1), (BUSY, 2), (SMALL, 2), (BUSY, 3), (BUSY, 4)]


def test_cancelled_waiter_is_skipped(start):
    queue, first, read = start(1), Held(), []
    begun = queue.submit(BUSY, first)
    assert first.began.wait(PATIENCE_S)
    leaving, last = (queue.submit(SMALL, lambda n=n: read.append(n)) for n in range(2))
    assert queue.waiting(SMALL) == 2
    assert leaving.cancel()
    assert queue.waiting(SMALL) == 1
    # What is being read is read to its end.
    assert not begun.cancel()
    first.go.set()
    last.result(PATIENCE_S)
    assert read == [1]


def test_error_is_raised_to_the_caller_and_the_thread_continues(start):
    queue = start(1)
    with pytest.raises(ZeroDivisionError):
        queue.submit(BUSY, lambda: 1 // 0).result(PATIENCE_S)
    assert queue.submit(BUSY, lambda: 1).result(PATIENCE_S) == 1


def test_closing_cancels_waiting_uploads(start):
    queue, first = start(1), Held()
    begun = queue.submit(BUSY, first)
    assert first.began.wait(PATIENCE_S)
    waiting = queue.submit(SMALL, lambda: None)
    waiting.add_done_callback(lambda future: first.go.set())
    queue.stop()
    assert waiting.cancelled()
    assert begun.done()


@pytest.mark.parametrize(
    ("cores", "memory_gib", "at_once"), [(1, 1, 3), (2, 24, 3), (16, 64, 8), (16, 999, 16)]
)
def test_there_are_as_many_readers_as_cores_and_half_of_the_memory_allow(
    monkeypatch, cores, memory_gib, at_once
):
    monkeypatch.setattr(fair_queue, "CPU_COUNT", cores)
    monkeypatch.setattr(fair_queue, "MEMORY_LIMIT", memory_gib * 2**30)
    assert readers_at_once(4 * 2**30) == at_once


ONE, OTHER = Tenant("one"), Tenant("other")


def test_uploads_are_limited_per_tenant_and_in_total():
    limits = UploadLimits(NoProjects(), of_account=2, in_all=3)
    with ExitStack() as stack:
        for tenant in (ONE, ONE, OTHER):
            stack.enter_context(limits(tenant))
        with pytest.raises(RateLimited, match="2 in progress; accepted: at most 2 per tenant"), limits(ONE):
            raise AssertionError
        with pytest.raises(Busy, match="3 in progress"), limits(Tenant("third")):
            raise AssertionError
    with limits(ONE), limits(Tenant("third")):
        pass


def test_failed_upload_is_removed():
    limits = UploadLimits(NoProjects(), of_account=1)
    for _ in range(3):
        with pytest.raises(ConnectionError), limits(ONE):
            raise ConnectionError


def test_new_uploads_per_minute_are_limited():
    limits = UploadLimits(NoProjects(), begun_per_minute=3)
    for _ in range(3):
        limits.check_begin(ONE)
    with pytest.raises(RateLimited, match="more than 3 new uploads per minute") as refused:
        limits.check_begin(ONE)
    assert 0.0 < refused.value.wait_s <= 20.0
    limits.check_begin(OTHER)

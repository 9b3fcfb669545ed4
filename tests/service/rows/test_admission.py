"""Few threads wait for a slow database, many for one that is well."""

import threading
from contextlib import ExitStack

import pytest

from bentray_service.errors import DatabaseUnavailable
from bentray_service.rows import database as admission
from bentray_service.rows.database import MAX_CONCURRENT, MAX_CONCURRENT_WHEN_SLOW, Admission

from ...clock import Clock


def test_many_at_once_while_it_is_quick():
    sign_in = Admission(Clock())
    with ExitStack() as stack:
        for _ in range(MAX_CONCURRENT):
            stack.enter_context(sign_in())


def test_few_once_the_oldest_has_taken_long():
    clock = Clock()
    sign_in = Admission(clock)
    with ExitStack() as stack:
        for _ in range(MAX_CONCURRENT_WHEN_SLOW):
            stack.enter_context(sign_in())
        clock.now = 2.5
        with pytest.raises(DatabaseUnavailable, match="8 requests waiting for a slow database"):
            stack.enter_context(sign_in())
    with sign_in():
        pass


def test_waits_briefly_for_a_free_connection(monkeypatch):
    monkeypatch.setattr(admission, "PLACE_SECONDS", 10.0)
    sign_in, come, left = Admission(Clock()), threading.Event(), threading.Event()

    def last():
        come.set()
        with sign_in():
            left.set()

    with ExitStack() as stack:
        for _ in range(MAX_CONCURRENT):
            stack.enter_context(sign_in())
        thread = threading.Thread(target=last)
        thread.start()
        assert come.wait(60.0)
        assert not left.is_set()
    assert left.wait(60.0)
    thread.join()


def test_the_one_after_all_places_is_rejected(monkeypatch):
    monkeypatch.setattr(admission, "PLACE_SECONDS", 0.0)
    sign_in = Admission(Clock())
    with ExitStack() as stack:
        for _ in range(MAX_CONCURRENT):
            stack.enter_context(sign_in())
        with pytest.raises(DatabaseUnavailable, match="32 requests waiting for the database"):
            stack.enter_context(sign_in())

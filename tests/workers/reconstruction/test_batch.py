"""Batches: a bounded number at once, in order, each failing by itself, and all stopped by Ctrl-C."""

import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Iteration, Progress
from bentray_workers.reconstruction import batch
from bentray_workers.reconstruction.batch import Entry, explain_failure, run


def entries(count: int) -> list[Entry]:
    return [Entry(Path(f"{number:03}.h5")) for number in range(count)]


def nothing() -> None:
    """Nobody watches."""


@settings(deadline=None, max_examples=20)
@given(fails=st.lists(st.booleans(), min_size=1, max_size=12), at_once=st.integers(1, 4))
def test_every_entry_finishes_within_the_limit_of_parallel_runs(fails: list[bool], at_once: int) -> None:
    given_entries = entries(len(fails))
    lock, now, most = threading.Lock(), [0], [0]
    begun: list[str] = []

    def work(entry: Entry, stop: Callable[[], bool]) -> None:
        with lock:
            begun.append(entry.name)
            now[0] += 1
            most[0] = max(most[0], now[0])
        time.sleep(0.001)
        with lock:
            now[0] -= 1
        if fails[int(entry.name)]:
            raise InvalidInput("sos", "7", "a scan")

    run(given_entries, work, nothing, at_once)
    assert most[0] <= at_once
    assert sorted(begun) == [entry.name for entry in given_entries]
    assert [entry.state for entry in given_entries] == ["failed" if fail else "succeeded" for fail in fails]
    assert [bool(entry.reason) for entry in given_entries] == fails


def test_batch_uses_all_allowed_slots() -> None:
    meet = threading.Barrier(3, timeout=60.0)
    given_entries = entries(6)
    run(given_entries, lambda entry, stop: meet.wait() and None, nothing, 3)
    assert {entry.state for entry in given_entries} == {"succeeded"}


def test_ctrl_c_stops_running_entries_and_starts_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch, "POLL_S", 0.01)
    stopped: list[str] = []

    def work(entry: Entry, stop: Callable[[], bool]) -> None:
        deadline = time.monotonic() + 60.0
        while not stop() and time.monotonic() < deadline:
            time.sleep(0.001)
        stopped.append(entry.name)

    def interrupt() -> None:
        raise KeyboardInterrupt

    given_entries = entries(5)
    with pytest.raises(KeyboardInterrupt):
        run(given_entries, work, interrupt, 2)
    assert sorted(stopped) == ["000", "001"]
    assert [entry.state for entry in given_entries] == ["running", "running", *3 * ["waiting"]]


def test_entries_report_progress_and_time() -> None:
    entry = Entry(Path("a/scan.h5"))
    assert (entry.name, entry.seconds) == ("scan", 0.0)
    entry.begin()
    entry.show(Progress(3, 8, (Iteration(0, 1, 2e-7, 8),)))
    assert (entry.done, entry.total, entry.residual_rms_s) == (3, 8, 2e-7)
    entry.end("succeeded")
    took = entry.seconds
    assert took > 0.0
    time.sleep(0.002)
    assert entry.seconds == took


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (InvalidInput("f", "1", "2"), "f: found 1; accepted: 2"),
        (MemoryError(), "the memory ran out"),
        (ValueError("several\n lines"), "ValueError: several lines"),
        (ZeroDivisionError(), "ZeroDivisionError"),
    ],
)
def test_reasons_are_one_line(error: Exception, words: str) -> None:
    assert explain_failure(error).startswith(words)
    assert "\n" not in explain_failure(error)

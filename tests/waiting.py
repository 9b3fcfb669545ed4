"""Waiting for what another thread or process does."""

import time


def wait_until(condition, patience_s=60.0, pause_s=0.02):
    """Call a condition until it is true, and return its value.

    Raises:
        AssertionError: if it is still false after ``patience_s``; the message holds its last value.
    """
    deadline = time.monotonic() + patience_s
    while not (value := condition()):
        assert time.monotonic() < deadline, f"still {value!r} after {patience_s} s"
        time.sleep(pause_s)
    return value

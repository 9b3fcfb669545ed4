"""HTTP load over loopback: a number of client threads, each with one connection, for a fixed time."""

import http.client
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from urllib.parse import urlsplit

import numpy as np

TIMEOUT_S = 60.0

# One request on a connection, the number of the request, and whether it was answered well.
Call = Callable[[http.client.HTTPConnection, int], bool]


@dataclass
class Calls:
    """Measurements of callers: seconds of each call, and how many were refused or broke."""

    seconds: list[float] = field(default_factory=list)
    failed: int = 0
    lasted_s: float = 0.0

    @property
    def per_second(self) -> float:
        return len(self.seconds) / self.lasted_s if self.lasted_s else 0.0

    def percentile(self, percent: float) -> float:
        """Seconds; NaN where there was no call."""
        return float(np.percentile(self.seconds, percent)) if self.seconds else float("nan")

    def __str__(self) -> str:
        return (
            f"{len(self.seconds)} calls, {self.failed} failed, {self.per_second:.0f} a second; "
            f"p50 {1e3 * self.percentile(50):.1f} ms, p99 {1e3 * self.percentile(99):.1f} ms, "
            f"longest {1e3 * self.percentile(100):.0f} ms"
        )


def connect(url: str) -> http.client.HTTPConnection:
    address = urlsplit(url)
    assert address.hostname in ("127.0.0.1", "localhost")
    return http.client.HTTPConnection(address.hostname, address.port, timeout=TIMEOUT_S)


@contextmanager
def calling(url: str, callers: int, call: Call, pause_s: float = 0.0) -> Iterator[Calls]:
    """Call all the time that the block takes; what is yielded is complete after it."""
    calls, stop, begun = Calls(), threading.Event(), time.perf_counter()
    lock = threading.Lock()

    def work(first: int) -> None:
        connection, number = connect(url), first
        while not stop.is_set():
            at = time.perf_counter()
            try:
                good = call(connection, number)
            except (OSError, http.client.HTTPException):
                good = False
                connection.close()
            taken = time.perf_counter() - at
            with lock:
                calls.seconds.append(taken)
                calls.failed += not good
            number += callers
            stop.wait(pause_s)
        connection.close()

    threads = [threading.Thread(target=work, args=(k,)) for k in range(callers)]
    for thread in threads:
        thread.start()
    try:
        yield calls
    finally:
        stop.set()
        for thread in threads:
            thread.join()
        calls.lasted_s = time.perf_counter() - begun


def load(url: str, callers: int, call: Call, seconds: float, pause_s: float = 0.0) -> Calls:
    """Call for so many seconds."""
    with calling(url, callers, call, pause_s) as calls:
        time.sleep(seconds)
    return calls


def got(connection: http.client.HTTPConnection, path: str) -> bool:
    """One GET."""
    connection.request("GET", path)
    answer = connection.getresponse()
    answer.read()
    return answer.status == 200

"""A service for a benchmark, and HTTP load over loopback: client threads with one connection each."""

import http.client
import os
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest.mock import patch
from urllib.parse import urlsplit

import numpy as np

from bentray_service.cli.service_process import running_service

TIMEOUT_S = 60.0

# One request on a connection, the number of the request, and whether it was answered well.
Call = Callable[[http.client.HTTPConnection, int], bool]

NONE: Mapping[str, str] = {}


@contextmanager
def served(settings: Mapping[str, str] = NONE) -> Iterator[tuple[str, Path]]:
    """Address of a new service with these environment variables, and a folder for files."""
    with tempfile.TemporaryDirectory() as name, patch.dict(os.environ, settings):
        folder = Path(name)
        with running_service(folder / "data", folder / "log") as url:
            yield url, folder


@contextmanager
def beside(works: Iterable[Callable[[threading.Event], object]]) -> Iterator[list[threading.Thread]]:
    """Run each in a thread of its own within the block; it returns once the event is set."""
    stop = threading.Event()
    threads = [threading.Thread(target=work, args=(stop,)) for work in works]
    for thread in threads:
        thread.start()
    try:
        yield threads
    finally:
        stop.set()
        for thread in threads:
            thread.join()


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
    calls, begun = Calls(), time.perf_counter()
    lock, numbers = threading.Lock(), iter(range(callers))

    def work(stop: threading.Event) -> None:
        connection, number = connect(url), next(numbers)
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

    try:
        with beside([work] * callers):
            yield calls
    finally:
        calls.lasted_s = time.perf_counter() - begun


def load(url: str, callers: int, call: Call, seconds: float, pause_s: float = 0.0) -> Calls:
    """Call for so many seconds."""
    with calling(url, callers, call, pause_s) as calls:
        time.sleep(seconds)
    return calls


def asked(
    connection: http.client.HTTPConnection, method: str, path: str, *content: Any
) -> http.client.HTTPResponse:
    """The answer, read to its end, to a request with a body and headers, if given."""
    connection.request(method, path, *content)
    answer = connection.getresponse()
    answer.read()
    return answer


def got(connection: http.client.HTTPConnection, path: str) -> bool:
    """One GET."""
    return asked(connection, "GET", path).status == 200

"""Comparison of engines on the device with compiled code, in one run: time, share of bandwidth, error."""

import time
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..opencl import Session, session_or_warning
from .engine import Engine
from .problems import engines

REPEATS = 5

# Of a copy in device memory that measures its bandwidth, bytes; a fraction of small memories.
COPIED_BYTES = 2**28


class Comparison(NamedTuple):
    """An engine, measured.

    Attributes:
        engine: the problem.
        compiled_s, device_s: least times of the repetitions, s; None where the device computes it wrong.
        difference: of the results, in the unit of the engine; None likewise.
        bandwidth_share: least memory traffic over time, as a share of the bandwidth of a copy on the device;
            above 1 for what its caches hold. None where memory does not bound the engine.
    """

    engine: Engine
    compiled_s: float | None = None
    device_s: float | None = None
    difference: float | None = None
    bandwidth_share: float | None = None

    @property
    def right(self) -> bool:
        """Whether the difference is within its bound."""
        return self.difference is not None and self.difference <= self.engine.bound


def compare(quick: bool) -> Iterator[Comparison]:
    """Compare every engine on the chosen device; nothing without one."""
    session = session_or_warning(instead="compiled code")
    if session is None:
        return
    bandwidth = copy_bytes_per_s(session)
    for engine in engines(quick):
        yield measured(engine, bandwidth, 1 if quick else REPEATS)


def measured(engine: Engine, bandwidth: float | None, repeats: int) -> Comparison:
    """Compare one engine.

    Args:
        engine: the problem.
        bandwidth: ``copy_bytes_per_s``; None: unknown.
        repeats: of each run, alternating, after one that is not timed.
    """
    if engine.there is None:
        return Comparison(engine)
    runs = engine.here, engine.there
    expected, computed = (run() for run in runs)
    least = [float("inf"), float("inf")]
    for _ in range(repeats):
        for k, run in enumerate(runs):
            start = time.perf_counter()
            run()
            least[k] = min(least[k], time.perf_counter() - start)
    share = None
    if engine.least_bytes is not None and bandwidth is not None:
        share = engine.least_bytes / least[1] / bandwidth
    return Comparison(engine, least[0], least[1], engine.error.of(computed, expected), share)


def copy_bytes_per_s(session: Session) -> float:
    """Bytes read and written per second by a copy from one buffer of the device to another."""
    import pyopencl as cl

    size = min(COPIED_BYTES, session.device.memory_bytes // 8 or COPIED_BYTES)
    with session.lock:
        source, target = session.upload(np.ones(size // 8)), session.reserve(size)
        least = float("inf")
        for _ in range(REPEATS):
            start = time.perf_counter()
            cl.enqueue_copy(session.queue, target, source, byte_count=size // 8 * 8)
            session.queue.finish()
            least = min(least, time.perf_counter() - start)
    return 2.0 * size / least

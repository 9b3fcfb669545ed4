"""A device that fails while it computes: a clean error, and the same computed once more on the CPU."""

import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from .session import Session

Result = TypeVar("Result")

_THREAD = threading.local()


class DeviceLostError(RuntimeError):
    """The device failed while it computed; the CPU can compute the same."""


@contextmanager
def computing_on(session: Session) -> Iterator[None]:
    """Turn any error of the device inside the block into ``DeviceLostError``, with a line in the log.

    Without memory for a problem the device remains usable; after any other error this process does not use
    it again.
    """
    # Imported here, so that pyopencl is loaded only with a device.
    import pyopencl as cl

    try:
        yield
    except cl.Error as error:
        reason = f"{session.device.label} failed: {str(error).splitlines()[0]}"
        if not isinstance(error, cl.MemoryError) or "OUT_OF_RESOURCES" in str(error):
            session.lost = reason
        logging.getLogger(__name__).warning("%s", reason)
        raise DeviceLostError(reason) from error


def computed(work: Callable[..., Result], *arguments: object) -> tuple[Result, str]:
    """The result of work that may use the device, computed again on the CPU, once, if the device is lost.

    Returns:
        The result, and why it was computed again; empty if it was not.
    """
    try:
        return work(*arguments), ""
    except DeviceLostError as error:
        return on_cpu(work, *arguments), str(error)


def with_cpu_retry(work: Callable[..., Result], *arguments: object) -> Result:
    """The result of ``computed`` alone; the log has the reason."""
    return computed(work, *arguments)[0]


def on_cpu(work: Callable[..., Result], *arguments: object) -> Result:
    """The result of work in this thread without any device."""
    before = cpu_only()
    _THREAD.cpu_only = True
    try:
        return work(*arguments)
    finally:
        _THREAD.cpu_only = before


def cpu_only() -> bool:
    """Whether this thread may not use a device."""
    return getattr(_THREAD, "cpu_only", False)

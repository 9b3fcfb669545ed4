"""Where an engine computes, on the OpenCL device or in compiled code: the one place that decides it."""

import logging
import os
import threading
import time
from functools import cache
from typing import NamedTuple

from ..errors import InvalidInput
from ..requests.names import REQUESTS
from .device_benchmark import ENGINES, MOST_ATTEMPTS, DeviceBenchmark, benchmark_engine, stored_benchmark
from .device_selection import open_session, select_device
from .devices import NEVER, VARIABLE, WISH, Device, find_devices, hidden, select_devices
from .lost_device import DeviceLostError, cpu_only
from .self_test_results import self_test_result, stored_self_test_result
from .session import Session

log = logging.getLogger(__name__)

# Most seconds that ``auto`` waits for the self-test and the benchmark of a card, and the least that are worth
# a start.
AUTO_S, LEAST_S = 10.0, 1.0
# One thread tests or tries at a time.
_TRYING = threading.Lock()


class Work(NamedTuple):
    """A problem of one engine.

    Attributes:
        engine: one of ``device_benchmark.ENGINES``.
        size: in the unit of the engine's benchmark: nodes, node updates or rays.
        memory_bytes, buffer_bytes: device memory that it cannot do without, and the largest buffer of it.
    """

    engine: str
    size: float
    memory_bytes: int = 0
    buffer_bytes: int = 0


def requested(device: str = "auto") -> str:
    """The meaning of a request on this machine: ``auto``, ``cpu`` or ``opencl``.

    ``BENTRAY_DEVICE`` takes the place of ``auto``; ``BENTRAY_DEVICE=cpu`` forbids devices.

    Raises:
        InvalidInput: for another word, and for ``opencl`` where devices are forbidden.
    """
    if device not in REQUESTS:
        raise InvalidInput("device", repr(device), "one of " + ", ".join(REQUESTS))
    here = os.environ.get(VARIABLE, "").strip().lower() or "auto"
    if here not in REQUESTS:
        raise InvalidInput(VARIABLE, repr(here), "one of " + ", ".join(REQUESTS))
    if device == "opencl" and here == "cpu":
        raise InvalidInput("device", "'opencl'", f"auto or cpu, because this machine has {VARIABLE}=cpu")
    return here if device == "auto" else device


def select_engine(work: Work, device: str = "auto") -> Session | None:
    """The open device that computes a problem; None: compiled code does.

    A processor is also an OpenCL device, but ``auto`` tests GPUs only: a processor is considered once
    ``bentray devices`` has tested it. A self-test and a benchmark, which are stored, take ``AUTO_S`` together
    at most.

    Args:
        work: the problem.
        device: the request.

    Raises:
        InvalidInput: as ``requested``; with ``opencl`` without a device that passes its self-test, or with
            too little memory.
        DeviceLostError: with ``opencl``, after the device failed in this process.
    """
    request = requested(device)
    if request == "cpu" or cpu_only():
        return None
    if request == "auto":
        candidate = _tested_device()
        if candidate is None or misfit(work, candidate):
            return None
        if not _benchmark_of(candidate, work.engine).faster(work.size):
            return None
        session = open_session(candidate)
        return None if session.lost else session
    chosen = _required()
    if reason := misfit(work, chosen):
        raise InvalidInput("device", f"'opencl', but {reason}", "auto or cpu, or a smaller problem")
    session = open_session(chosen)
    if session.lost:
        raise DeviceLostError(session.lost)
    return session


def may_select_device() -> bool:
    """Whether ``auto`` may find a device on this machine: False without one that it may use."""
    request = requested()
    return request == "opencl" or (request == "auto" and not cpu_only() and _tested_device() is not None)


def check_available(device: str) -> None:
    """Check, before any work, that a device that is requested exists and passes its self-test.

    Raises:
        InvalidInput: as ``select_engine``.
    """
    if requested(device) == "opencl" and not cpu_only():
        _required()


def misfit(work: Work, device: Device) -> str:
    """Why a problem does not fit into the memory of a device; empty if it does."""
    limits = (
        ("device memory", work.memory_bytes, device.memory_bytes),
        ("one buffer", work.buffer_bytes, device.buffer_bytes),
    )
    for what, needed, limit in limits:
        if limit and needed > limit:
            return f"it needs {needed} bytes of {what}, and {device.name} has {limit}"
    return ""


def _required() -> Device:
    chosen = select_device()
    if chosen.device is None:
        given = f"'opencl', but {chosen.reason}"
        raise InvalidInput("device", given, "auto or cpu, or see `bentray devices`")
    return chosen.device


def _tested_device() -> Device | None:
    """The device that ``auto`` may use."""
    devices = _devices(os.environ.get(WISH), hidden())
    if any(_is_card(device) for device in devices):
        with _TRYING:
            return _passing(devices)[0]
    for device in devices:
        if stored_self_test_result(device) is not None and any(
            stored_benchmark(device, engine) for engine in ENGINES
        ):
            return device
    return None


def _is_card(device: Device) -> bool:
    return device.kind in ("gpu", "accelerator")


@cache
def _passing(devices: tuple[Device, ...]) -> tuple[Device | None, float]:
    """The first device that passes its self-test, once per process, and the seconds left to benchmark it."""
    end = time.monotonic() + AUTO_S
    for device in devices:
        if (left := end - time.monotonic()) < LEAST_S:
            break
        if stored_self_test_result(device) is None:
            log.warning("%s is tested once, for at most %.0f s", device.name, left)
        result = self_test_result(device, left)
        if result.usable:
            return device, end - time.monotonic()
        log.warning("%s was refused: %s; %s=%s skips the test", device.name, result.reason, VARIABLE, NEVER)
    return None, 0.0


def _benchmark_of(device: Device, engine: str) -> DeviceBenchmark:
    """The stored benchmark of a device; a new one of a card, once per process."""
    with _TRYING:
        stored = stored_benchmark(device, engine)
        final = stored is not None and (not stored.fault or stored.attempts >= MOST_ATTEMPTS)
        if final or not _is_card(device):
            return stored or DeviceBenchmark()
        return _tried(device, engine)


@cache
def _tried(device: Device, engine: str) -> DeviceBenchmark:
    left = _passing(_devices(os.environ.get(WISH), hidden()))[1]
    if left < LEAST_S:
        return DeviceBenchmark()
    log.warning("%s is tried for %s once, for at most %.0f s", device.name, engine, left)
    result = benchmark_engine(device, engine, left)
    if result.fault:
        instead = "compiled code computes; `bentray devices` tries it for longer"
        log.warning("%s was tried for %s: %s; %s", device.name, engine, result.fault, instead)
    return result


@cache
def _devices(selection: str | None, _hidden: str) -> tuple[Device, ...]:
    """Those to test, in order; they are listed once per process and selection."""
    return select_devices(find_devices(), selection)

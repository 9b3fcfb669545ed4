"""The OpenCL device of the kernels: selected or best, tested and open; or none, with one warning."""

import os
import threading
import warnings
from dataclasses import dataclass
from functools import cache

from .devices import WISH, Device, find_devices, hidden, select_devices
from .lost_device import DeviceLostError, cpu_only
from .self_test_results import self_test_result
from .session import Session


class OpenCLFallbackWarning(UserWarning):
    """No OpenCL device passes its self-test; the CPU computes instead, without OpenCL."""


@dataclass(frozen=True)
class DeviceSelection:
    """The device to use, and the devices rejected before it.

    Attributes:
        device: None where none passed.
        refusals: a message for each rejected device.
    """

    device: Device | None
    refusals: tuple[str, ...]

    @property
    def reason(self) -> str:
        """Why there is no device; empty where there is one."""
        if self.device is not None:
            return ""
        if reason := hidden():
            return f"{reason} hides every device"
        return "; ".join(self.refusals) or "this machine has no OpenCL device"


def select_device() -> DeviceSelection:
    """The first device that passes its self-test: the one of ``BENTRAY_OPENCL_DEVICE``, or GPUs first.

    Raises:
        InvalidInput: when the variable matches no device or more than one.
    """
    refusals: list[str] = []
    for device in select_devices(find_devices(), os.environ.get(WISH)):
        result = self_test_result(device)
        if result.usable:
            return DeviceSelection(device, tuple(refusals))
        refusals.append(f"{device.label} was refused: {result.reason}")
    return DeviceSelection(None, tuple(refusals))


def session_or_warning(instead: str) -> Session | None:
    """The chosen device, open; or None after a warning that names what is used instead.

    None without a warning where this thread may not use a device, see ``lost_device.on_cpu``.

    Args:
        instead: the method that takes over.

    Raises:
        InvalidInput: as ``select_device``.
        DeviceLostError: after the device failed in this process.
    """
    if cpu_only():
        return None
    # Only one thread may test or open a device at a time.
    with _OPENING:
        session = _found(os.environ.get(WISH), hidden())
        if isinstance(session, str):
            _warn_once(instead, session)
            return None
    if session.lost:
        raise DeviceLostError(session.lost)
    return session


def open_session(device: Device) -> Session:
    """The device, open; the same for every caller in this process."""
    with _OPENING:
        return _opened(device)


_OPENING = threading.Lock()


@cache
def _opened(device: Device) -> Session:
    return Session(device)


@cache
def _found(_selection: str | None, _hidden: str) -> Session | str:
    """The open device, or the reason for none; once per selection and process."""
    choice = select_device()
    return choice.reason if choice.device is None else _opened(choice.device)


@cache
def _warn_once(instead: str, reason: str) -> None:
    # A warning turned into an error is not cached, so it is raised each time.
    message = f"no OpenCL device can be used, {instead} takes over: {reason} (see `bentray devices`)"
    warnings.warn(OpenCLFallbackWarning(message), stacklevel=5)

"""The device that the kernels use: wished for or best, tried, and open; or none, with one warning."""

from __future__ import annotations

import os
import threading
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import TypeVar

from .devices import NONE, WISH, Device, find_devices, hidden, wished
from .session import Session
from .verdict import verdict_on

Placed = TypeVar("Placed")


class OpenCLFallbackWarning(UserWarning):
    """No OpenCL device can be trusted; the same is computed on the CPU without OpenCL."""


@dataclass(frozen=True)
class Choice:
    """The device to use and what was refused before it was found.

    Attributes:
        device: None where none passed.
        refusals: a sentence for each refused device.
    """

    device: Device | None
    refusals: tuple[str, ...]

    @property
    def reason(self) -> str:
        """Why there is no device; empty where there is one."""
        if self.device is not None:
            return ""
        if hidden():
            return f"{WISH}={NONE} hides every device"
        return "; ".join(self.refusals) or "this machine has no OpenCL device"


def choose() -> Choice:
    """The first device that passes its trial: the one of ``BENTRAY_OPENCL_DEVICE``, or GPUs first.

    Raises:
        InvalidInput: when the variable fits no device or more than one.
    """
    refusals: list[str] = []
    for device in wished(find_devices(), os.environ.get(WISH)):
        verdict = verdict_on(device)
        if verdict.usable:
            return Choice(device, tuple(refusals))
        refusals.append(f"{device.label} was refused: {verdict.reason}")
    return Choice(None, tuple(refusals))


def session_or_warning(instead: str) -> Session | None:
    """The chosen device, open; or None after a warning that names what is used instead.

    Args:
        instead: the method that takes over.

    Raises:
        InvalidInput: as ``choose``.
    """
    # Two threads must not try or open one device at the same time.
    with _OPENING:
        found = _found(os.environ.get(WISH))
        if isinstance(found, Session):
            return found
        _warn_once(instead, found)
        return None


def scene_or_warning(build: Callable[[Session], Placed], instead: str) -> Placed | None:
    """What ``build`` puts on the chosen device; or None after a warning, also if it cannot hold it.

    Args:
        build: makes it in an open session.
        instead: what takes over.

    Raises:
        InvalidInput: as ``choose``, and what ``build`` raises.
    """
    session = session_or_warning(instead)
    if session is None:
        return None
    # Here, so that whoever has no device never loads it.
    import pyopencl as cl

    try:
        return build(session)
    except cl.Error as error:
        message = f"{session.handle.name} cannot hold the scene, {instead} takes over: {error}"
        warnings.warn(OpenCLFallbackWarning(message), stacklevel=3)
        return None


_OPENING = threading.Lock()


@cache
def _found(wish: str | None) -> Session | str:
    """The open device or why there is none; asked for once by each wish in a process."""
    choice = choose()
    if choice.device is not None:
        return Session(choice.device)
    return choice.reason


@cache
def _warn_once(instead: str, reason: str) -> None:
    # A warning made an error is not remembered, so it is raised each time.
    message = f"no OpenCL device can be used, {instead} takes over: {reason} (see `bentray devices`)"
    warnings.warn(OpenCLFallbackWarning(message), stacklevel=5)
